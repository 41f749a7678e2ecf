// SPDX-License-Identifier: Apache-2.0

#include <algorithm>
#include <cmath>

#include "api/descriptors.h"
#include "api/fields.h"
#include "api/handles.h"
#include "api/render_launch.h"
#include "api/struct_table.h"
#include "device/error.h"
#include "device/struct_read.h"
#include "device/struct_table.h"
#include "render/renderer.h"

namespace kuafu {
namespace {

constexpr uint32_t possible_outputs =
    1u << output_radiance | projector_parts | 1u << output_projector | 1u << output_depth | 1u << output_projector_visibility;
constexpr double most_aside_m = 5e-3, most_turned = 1e-2;  // of a right camera, from the left one's row

std::shared_ptr<ks::Buffer> read_image(kuafu_buffer handle, const char* name, uint64_t words, const ks::Device& device) {
  if (handle == nullptr) return nullptr;
  const std::shared_ptr<ks::Buffer>& buffer = ks::object_of(handle, name);
  if (buffer->device().get() != &device)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: its buffer belongs to another device than the renderer", name);
  if (buffer->size_bytes() < words * 4)
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "%s has %llu bytes, the images of all environments need %llu (supersampling multiplies rows and columns)", name,
             static_cast<unsigned long long>(buffer->size_bytes()), 4 * static_cast<unsigned long long>(words));
  return buffer;
}

GbufferImages read_images(const kuafu_gbuffer* desc, const char* name, uint64_t pixels, const ks::Device& device) {
  const kuafu_gbuffer d = ks::read_struct(desc, KUAFU_TYPE_GBUFFER, name);
  const auto image = [&](kuafu_buffer buffer, const char* which, uint64_t channels) {
    return read_image(buffer, (std::string(name) + "." + which).c_str(), pixels * channels, device);
  };
  GbufferImages images{image(d.depth, "depth", 1), image(d.normal, "normal", 3), image(d.albedo, "albedo", 1),
                       image(d.material, "material", 1)};
  if (!images.depth) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.depth is NULL: give the camera's depth", name);
  return images;
}

/// A camera without what a G-buffer has not.
void check_pinhole(const View& view, const char* name) {
  if (view.special()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has a lens, or moves: G-buffers are of pinholes at rest", name);
  if (view.environment != 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s.environment is %u, it must be 0", name, view.environment);
}

void check_row(const View& left, const View& right) {
  const glm::dmat4 place = glm::inverse(left.camera_to_world) * right.camera_to_world;
  double turned = 0.0;
  for (int i = 0; i < 9; ++i) turned = std::max(turned, std::abs(place[i / 3][i % 3] - (i % 4 == 0 ? 1.0 : 0.0)));
  if (turned > most_turned || std::abs(place[3][1]) > most_aside_m || std::abs(place[3][2]) > most_aside_m)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "right_view stands at (%g, %g, %g) m from the left one, turned by %g: it must stand in its row",
             place[3][0], place[3][1], place[3][2], turned);
}

/// [count], or the same number for all.
std::vector<float> read_numbers(const float* values, uint32_t count, float otherwise, const char* name) {
  std::vector<float> numbers(count, otherwise);
  if (values != nullptr) std::copy_n(values, count, numbers.begin());
  for (uint32_t i = 0; i < count; ++i)
    if (!(numbers[i] >= 0.0f && std::isfinite(numbers[i])))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s[%u] is %g, it must be finite and >= 0", name, i, double(numbers[i]));
  return numbers;
}

/// The sum of the projector's parts, if it alone is asked for, goes through the optics, which are linear, as one image.
void join_projector_parts(GbufferLaunch& gbuffers) {
  auto& outputs = gbuffers.launch.outputs;
  if (!outputs[output_projector].buffer || outputs[output_projector_direct].buffer || outputs[output_projector_indirect].buffer) return;
  gbuffers.laser_as_one = true;
  std::swap(outputs[output_projector], outputs[output_projector_direct]);
  hold_images(gbuffers.launch);
}

}  // namespace

GbufferLaunch read_gbuffers(const kuafu_gbuffer_desc* desc, const Scene& scene, const std::shared_ptr<ks::Device>& device) {
  kuafu_gbuffer_desc d = ks::read_struct(desc, KUAFU_TYPE_GBUFFER_DESC, "gbuffer desc");
  d.supersampling = std::max(d.supersampling, 1u);  // 0 in an older caller's shorter struct
  check_fields(d, "");
  if (d.environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "environment_count is 0: there is nothing to light");
  const kuafu_view_desc pair[2] = {ks::read_struct(d.left_view, KUAFU_TYPE_VIEW_DESC, "left_view"),
                                   ks::read_struct(d.right_view, KUAFU_TYPE_VIEW_DESC, "right_view")};
  kuafu_render_desc as_render = kuafu_render_desc_init();
  as_render.views = pair;
  as_render.view_count = 2;
  as_render.outputs = d.outputs;
  as_render.output_count = d.output_count;
  GbufferLaunch out;
  out.launch = read_pair(as_render, d.environment_count, *device);
  out.launch.pixel_blur_px = d.pixel_blur_px;
  const Launch& launch = out.launch;
  if (!launch.band.infrared) ks::fail(KS_ERROR_INVALID_ARGUMENT, "left_view is visible: G-buffers are lit in the infrared");
  const View &left = launch.views[0], &right = launch.views[d.environment_count];
  check_pinhole(left, "left_view");
  check_pinhole(right, "right_view");
  check_row(left, right);
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (launch.outputs[kind].buffer && (possible_outputs >> kind & 1) == 0)
      ks::fail(KS_ERROR_INVALID_ARGUMENT,
               "outputs has one that G-buffers have not: radiance, projector (direct, indirect, both), depth and projector visibility");
  out.supersampling = d.supersampling;
  const uint64_t pixels = uint64_t(launch.pixel_count()) / 2 * d.supersampling * d.supersampling;
  if (pixels / d.environment_count >> (32 - gbuffer_error_bits) != 0 || pixels >> 30 != 0)
    ks::fail(KS_ERROR_INVALID_ARGUMENT,
             "%u pairs of %u x %u pixels under supersampling %u are too large: at most 2^28 pixels a view, 2^31 in all",
             d.environment_count, launch.width, launch.height, d.supersampling);
  out.given[0] = read_images(d.left, "left", pixels, *device);
  if (d.right != nullptr) out.given[1] = read_images(d.right, "right", pixels, *device);
  out.projector_depth = read_image(d.projector_depth, "projector_depth", pixels, *device);
  out.along_rays = d.depth_kind == KUAFU_GBUFFER_DEPTH_RAY;
  out.power = read_numbers(d.laser_power, d.environment_count, 1.0f, "laser_power");
  const Environment& room = scene.environment();
  const Band band{.infrared = true, .ir_ambient_scale = as_render.ir_ambient_scale, .ir_ambient_radiance = as_render.ir_ambient_radiance};
  out.ambient =
      read_numbers(d.ambient_radiance, d.environment_count, band.environment(room.radiance, room.ir_radiance).x, "ambient_radiance");
  join_projector_parts(out);
  return out;
}

}  // namespace kuafu
