// SPDX-License-Identifier: Apache-2.0
#include "api/render_launch.h"

#include <algorithm>
#include <limits>

#include "api/descriptors.h"
#include "api/fields.h"
#include "api/struct_table.h"
#include "device/error.h"
#include "device/struct_read.h"
#include "device/struct_table.h"
#include "render/renderer.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

using ull = unsigned long long;

static_assert(uint32_t(LightSampling::mis) == KUAFU_SAMPLING_MIS && uint32_t(LightSampling::lights) == KUAFU_SAMPLING_LIGHTS &&
                  uint32_t(LightSampling::bsdf) == KUAFU_SAMPLING_BSDF,
              "the two count alike");
static_assert(uint32_t(DenoiseKind::none) == KUAFU_DENOISE_NONE && uint32_t(DenoiseKind::atrous) == KUAFU_DENOISE_ATROUS &&
                  uint32_t(DenoiseKind::oidn) == KUAFU_DENOISE_OIDN,
              "the two count alike");

constexpr uint32_t most_pixels_per_side = 32768, most_environments = 65536;

void check_numbers(const kuafu_render_desc& d) {
  check_fields(d, "");
  if (d.view_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "view_count is 0: there is nothing to render");
  if (d.output_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "output_count is 0: ask for at least one output");
  if (d.samples_per_pixel > std::numeric_limits<uint32_t>::max() - d.first_sample)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "first_sample %u + samples_per_pixel %u is beyond 2^32 - 1", d.first_sample, d.samples_per_pixel);
  if (!(d.temporal_weight < 1.0f))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "temporal_weight is %g, it must be below 1", double(d.temporal_weight));
}

void check_size(const kuafu_camera_desc& first, const kuafu_camera_desc& camera, uint32_t view) {
  if (camera.width == 0 || camera.height == 0 || camera.width > most_pixels_per_side || camera.height > most_pixels_per_side)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u] is %u x %u pixels, each side must be 1..%u", view, camera.width, camera.height,
             most_pixels_per_side);
  if (camera.width != first.width || camera.height != first.height)
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "views[%u] is %u x %u pixels and views[0] is %u x %u: render sizes that differ in calls of their own", view, camera.width,
             camera.height, first.width, first.height);
}

/// The search for a fold takes 0.1 ms: views of one lens share it.
bool same_lens(const Camera& camera, const Launch& launch) {
  if (launch.views.empty()) return false;
  const View& before = launch.views.back();
  return camera.lens.distortion == before.lens.distortion && camera.k == before.k;
}

/// All zeros say that the camera stood still.
glm::dmat4 read_previous_pose(const kuafu_view_desc& desc, const Camera& camera) {
  const glm::dmat4 pose = from_row_major<4>(desc.previous_camera_to_world);
  if (pose == glm::dmat4(0.0)) return camera.camera_to_world;
  check_rigid(pose, (camera.name + ".previous_camera_to_world").c_str());
  return pose;
}

/// NULL gives perfect optics. Errors name `view`, the field and the number.
Optics read_optics(const kuafu_optics_desc* desc, const std::string& view) {
  Optics optics;
  if (desc == nullptr) return optics;
  copy_fields(ks::read_struct(desc, KUAFU_TYPE_OPTICS_DESC, "optics desc"), optics);
  check_fields(optics, view + ".optics.");
  if (optics.defocuses() && !(optics.defocus_focus_m > 0.0))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.optics.defocus_focus_m is %g, it must be > 0 where there is a lens", view.c_str(),
             optics.defocus_focus_m);
  return optics;
}

View read_view(const kuafu_view_desc& desc, uint32_t index, const Launch& launch) {
  auto camera = copied<Camera>(desc.camera);
  camera.name = "views[" + std::to_string(index) + "]";
  check(camera);
  if (!same_lens(camera, launch)) check_undistortable(camera);
  if (desc.environment >= most_environments)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u].environment is %u, it must be below %u", index, desc.environment, most_environments);
  return {.k = camera.k,
          .camera_to_world = camera.camera_to_world,
          .near_m = camera.near_m,
          .far_m = camera.far_m,
          .environment = desc.environment,
          .optics = read_optics(desc.optics, camera.name),
          .lens = camera.lens,
          .shutter = camera.shutter,
          .velocity = camera.velocity,
          .previous_camera_to_world = read_previous_pose(desc, camera)};
}

void read_views(const kuafu_render_desc& desc, Launch& launch) {
  kuafu_view_desc first{};
  for (uint32_t i = 0; i < desc.view_count; ++i) {
    const kuafu_view_desc view = ks::read_element(desc.views, i, KUAFU_TYPE_VIEW_DESC, "views");
    ks::check_embedded(view.camera, KUAFU_TYPE_CAMERA_DESC, "views[].camera");
    if (i == 0) first = view;
    check_size(first.camera, view.camera, i);
    check_fields(view, "views[" + std::to_string(i) + "].");
    if (view.band != first.band)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "views[%u] is %s and views[0] is not: render each band in a call of its own", i,
               view.band == KUAFU_BAND_INFRARED ? "infrared" : "visible");
    launch.views.push_back(read_view(view, i, launch));
  }
  launch.width = first.camera.width;
  launch.height = first.camera.height;
  launch.band = {.infrared = first.band == KUAFU_BAND_INFRARED,
                 .ir_ambient_scale = desc.ir_ambient_scale,
                 .ir_ambient_radiance = desc.ir_ambient_radiance};
  const ull pixels = ull(launch.views.size()) * launch.width * launch.height;
  if (pixels > std::numeric_limits<int32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%u views of %u x %u are %llu pixels, at most 2^31 - 1 fit one call", desc.view_count, launch.width,
             launch.height, pixels);
}

}  // namespace

Launch read_launch(const kuafu_render_desc* desc, const std::shared_ptr<ks::Device>& device) {
  const kuafu_render_desc d = ks::read_struct(desc, KUAFU_TYPE_RENDER_DESC, "render desc");
  check_numbers(d);
  Launch launch;
  read_views(d, launch);
  read_outputs(d, *device, launch);
  launch.samples = d.samples_per_pixel;
  launch.first_sample = d.first_sample;
  launch.max_bounces = d.max_bounces;
  launch.seed = d.seed;
  launch.projector = d.projector - 1;  // an id; none is 0xffffffff
  launch.accumulate = d.accumulate != 0;
  launch.max_seconds = d.max_seconds;
  launch.relative_error = d.relative_error;
  launch.glass_surfaces = d.glass_surfaces;
  launch.straight_through_glass = d.glass_shadows == KUAFU_GLASS_SHADOWS_STRAIGHT;
  launch.pixel_blur_px = d.pixel_blur_px;
  launch.light_sampling = static_cast<LightSampling>(d.light_sampling);
  launch.denoise = static_cast<DenoiseKind>(d.denoise);
  launch.temporal_weight = d.temporal_weight;
  launch.wait = ks::point_of(device, d.wait);
  hold_images(launch);
  if (d.progress != nullptr) launch.cancelled = [f = d.progress, user = d.progress_user](float fraction) { return f(user, fraction) != 0; };
  return launch;
}

Launch read_pair(const kuafu_render_desc& pair, uint32_t environments, const ks::Device& device) {
  Launch launch;
  read_views(pair, launch);
  const ull pixels = ull(2) * environments * launch.width * launch.height;
  if (pixels > std::numeric_limits<int32_t>::max())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%u pairs of %u x %u are %llu pixels, at most 2^31 - 1 fit one call", environments, launch.width,
             launch.height, pixels);
  const View left = launch.views[0], right = launch.views[1];
  launch.views.assign(size_t(2) * environments, right);
  std::fill_n(launch.views.begin(), environments, left);
  read_outputs(pair, device, launch);
  hold_images(launch);
  return launch;
}

}  // namespace kuafu
