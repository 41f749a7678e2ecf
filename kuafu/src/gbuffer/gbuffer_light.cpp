// SPDX-License-Identifier: Apache-2.0
#include "gbuffer/gbuffer_light.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "device/error.h"
#include "spirv/gbuffer.h"
#include "tables/instance_table.h"

namespace kuafu {
namespace {

constexpr double least_depth_m = 0.1;  // beams are as wide as they are here at most
constexpr size_t most_named = 8;       // environments, in an error

/// The projector that the tables list first.
const Light* first_projector(const Scene& scene, const Band& band) {
  for (const std::optional<Light>& light : scene.lights())
    if (light && light->kind == Light::Kind::projector && (light->texture != none || light->raster) &&
        band.intensity(light->intensity, light->ir_intensity, light->ir_share) != glm::vec3(0))
      return &*light;
  return nullptr;
}

float value_at(const ks::Buffer& buffer, uint64_t word) {
  float value = 0;
  buffer.read(word * 4, &value, sizeof value);
  return value;
}

/// The fault of a pixel of an image, and the remedy.
std::string complaint(const GbufferImages& images, uint32_t what, uint64_t pixel, uint32_t materials) {
  char text[160];
  if (what == gbuffer_bad_depth) {
    std::snprintf(text, sizeof text, "depth is %g, expected metres from 0 on, 0 or inf = nothing there",
                  double(value_at(*images.depth, pixel)));
  } else if (what == gbuffer_bad_normal) {
    float n[3];
    images.normal->read(pixel * 12, n, sizeof n);
    std::snprintf(text, sizeof text, "the length of normal is %g, expected unit vectors", double(std::hypot(n[0], n[1], n[2])));
  } else if (what == gbuffer_bad_albedo) {
    std::snprintf(text, sizeof text, "albedo is %g, expected 0 to 1", double(value_at(*images.albedo, pixel)));
  } else {
    uint32_t number = 0;
    images.material->read(pixel * 4, &number, sizeof number);
    std::snprintf(text, sizeof text, "material is %u, expected a number below %u: 0, or 1 + the id of a material that is there", number,
                  materials);
  }
  return text;
}

/// The pair's cameras with the given images' pixels, and all light and depth in the frame.
GbufferLaunch supersampled(const GbufferLaunch& pair) {
  GbufferLaunch fine = pair;
  Launch& launch = fine.launch;
  const uint32_t n = pair.supersampling;
  launch.width *= n;
  launch.height *= n;
  launch.pixel_blur_px *= float(n);
  const double centre = 0.5 * (n - 1);  // of the samples of pixel 0
  for (View& view : launch.views) view.k = glm::dmat3(n, 0, 0, 0, n, 0, centre, centre, 1) * view.k;
  for (uint32_t kind = 0; kind < output_kind_count; ++kind)
    if (std::exchange(launch.outputs[kind], {}).buffer && !is_made(kind)) launch.held |= 1u << kind;
  return fine;
}

}  // namespace

GbufferLight::GbufferLight(Memory memory)
    : memory_(memory), tables_(memory), step_(memory, gbuffer_spirv, host::gbuffer), samples_(memory) {}

void GbufferLight::run(ks::Commands& commands, const Scene& scene, const GbufferLaunch& pair, const Frame& frame) {
  const std::optional<GbufferLaunch> fine = pair.supersampling > 1 ? std::optional(supersampled(pair)) : std::nullopt;
  const GbufferLaunch& gbuffers = fine ? *fine : pair;
  if (fine) samples_.fit(fine->launch);
  tables_.update(scene, gbuffers.launch.band, 1, {});
  fit(gbuffers);
  prepare_pattern(scene, gbuffers);
  GbufferRecord record = record_of(scene, gbuffers, fine ? samples_ : frame);
  record.averaged = frame.outputs();
  record_.resize(memory_, 1)[0] = record;
  const Launch& launch = gbuffers.launch;
  const uint32_t pixels = launch.pixel_count(), camera_pixels = pixels / 2;
  const uint32_t given_cameras = gbuffers.given[1].depth ? 2 : 1, cells = gbuffers.environments() * record.cell_columns * record.cell_rows;
  const auto step = [&](const char* name, uint32_t which, uint32_t count) {
    step_.run(commands, name, GbufferPush{.record = record_.address(), .step = which, .count = count}, which);
  };
  step("read", gbuffer_read, camera_pixels * (gbuffers.projector_depth ? 3 : given_cameras));
  for (const uint32_t which : {gbuffer_between, gbuffer_middles, gbuffer_warp}) step("warp", which, pixels);
  step("light", gbuffer_light, pixels);
  step("bounce", gbuffer_cells, cells);
  step("bounce", gbuffer_sky, cells);
  step("bounce", gbuffer_smooth, cells);
  step("bounce", gbuffer_bounce, pixels);
  if (!memory_.on_host) step("bounce", gbuffer_lobes, (pixels + 3) / 4);
  step("blend", gbuffer_blend, pixels);
  if (fine) step("average", gbuffer_average, pair.launch.pixel_count());
}

void GbufferLight::fit(const GbufferLaunch& gbuffers) {
  const Launch& launch = gbuffers.launch;
  const uint64_t pixels = launch.pixel_count(), camera = pixels / 2;
  const auto cells_along = [](uint32_t pixel_count) { return (pixel_count + gbuffer_cell_px - 1) / gbuffer_cell_px; };
  for (auto& inverse : inverse_) grow(memory_, inverse, camera);
  grow(memory_, source_, camera);
  grow(memory_, projector_inverse_, camera);
  for (auto* image : {&matt_, &lobes_, &laser_}) grow(memory_, *image, pixels);
  grow(memory_, lobe_pixels_, memory_.on_host ? 2 : 2 + pixels);
  grow(memory_, cells_,
       uint64_t(gbuffers.environments()) * cells_along(launch.width) * cells_along(launch.height) * (sizeof(GbufferCell) / 4));
  const uint64_t error_bytes = uint64_t(gbuffers.environments()) * 4;
  if (!errors_ || errors_->size_bytes() < error_bytes) errors_ = ks::Buffer::create(memory_.device, error_bytes, KS_BUFFER_HOST_VISIBLE);
  std::memset(errors_->mapped(), 0xff, error_bytes);
}

/// Found again where the pattern, the projector's lens or a camera's pixel is another.
void GbufferLight::prepare_pattern(const Scene& scene, const GbufferLaunch& gbuffers) {
  projector_ = first_projector(scene, gbuffers.launch.band);
  if (projector_ == nullptr) return;
  const Light& light = *projector_;
  const glm::dmat3& k = gbuffers.launch.views[0].k;
  const glm::dvec2 projector_focal(light.k[0][0] / light.pattern_scale, light.k[1][1] / light.pattern_scale);
  const bool blurs = light.radius_m > 0 && light.focus_m > 0;
  const double diameter = blurs ? 2 * projector_focal.x * light.radius_m * std::abs(1 / least_depth_m - 1 / light.focus_m) : 0;
  const Texture& image = pattern_of(scene, light);
  // A blur adds its variance to the pixel's: the means are of a wider pixel.
  const double side_px = std::hypot(1.0, double(gbuffers.launch.pixel_blur_px));
  const PatternKey key{
      scene.identity(), light.texture, image.revision, light.raster, side_px * projector_focal / glm::dvec2(k[0][0], k[1][1]), diameter};
  if (key == pattern_key_) return;
  const PatternStack stack = pattern_stack(image, key.pixel_px, diameter, memory_.device->workers());
  means_ = ks::Buffer::create_array(memory_.device, stack.means.size() * 4);
  means_->write(0, stack.means.data(), stack.means.size() * 4);
  pattern_ = {
      .means = memory_.address(*means_), .width = stack.width, .height = stack.height, .levels = stack.levels, .step_px = stack.step_px};
  pattern_key_ = key;
}

GbufferCamera GbufferLight::camera_of(const GbufferLaunch& gbuffers, uint32_t camera) const {
  GbufferCamera record{};
  const GbufferImages& given = gbuffers.given[camera];
  const View &view = gbuffers.launch.views[camera * gbuffers.environments()], &left = gbuffers.launch.views[0];
  const auto address = [&](const std::shared_ptr<ks::Buffer>& buffer) { return buffer ? memory_.address(*buffer) : 0; };
  record.depth = address(given.depth);
  record.normal = address(given.normal);
  record.albedo = address(given.albedo);
  record.material = address(given.material);
  record.inverse_depth = memory_.address(*inverse_[camera]);
  record.source = memory_.address(*source_);
  record.view = view_record(gbuffers.launch, view);
  record.axis_x = glm::vec3(view.camera_to_world[0]);
  record.axis_y = glm::vec3(view.camera_to_world[1]);
  record.axis_z = glm::vec3(view.camera_to_world[2]);
  record.focal = {float(view.k[0][0]), float(view.k[1][1])};
  record.centre = glm::vec2(view.k[2]);
  record.given = (given.depth ? gbuffer_has_depth : 0) | (given.normal ? gbuffer_has_normal : 0) | (given.albedo ? gbuffer_has_albedo : 0) |
                 (given.material ? gbuffer_has_material : 0);
  const glm::dvec3 way = projector_ == nullptr ? glm::dvec3(0) : glm::dvec3(projector_->light_to_world[3] - view.camera_to_world[3]);
  record.projector_px_m = float(view.k[0][0] * glm::dot(way, glm::dvec3(view.camera_to_world[0])));
  record.shift_px = float(view.k[2][0] - left.k[2][0]);
  return record;
}

GbufferRecord GbufferLight::record_of(const Scene& scene, const GbufferLaunch& gbuffers, const Frame& frame) {
  const Launch& launch = gbuffers.launch;
  const View &left = launch.views[0], &right = launch.views[gbuffers.environments()];
  std::ranges::copy(gbuffers.power, power_.resize(memory_, gbuffers.power.size()).begin());
  std::ranges::copy(gbuffers.ambient, ambient_.resize(memory_, gbuffers.ambient.size()).begin());
  const auto places = places_.resize(memory_, scene.materials().ids_given() + 1);
  const auto measured = measured_.resize(memory_, scene.materials().ids().size() + 1);
  std::ranges::fill(places, 0u);
  std::ranges::fill(measured, 0u);
  for (const uint32_t id : scene.materials().ids()) {
    if (id == none) continue;
    const uint32_t place = places[id + 1] = material_index(scene, id);
    measured[place] = std::isnan(scene.materials()[id].ir_albedo) ? 0 : 1;
  }
  GbufferRecord r{};
  for (uint32_t camera = 0; camera < 2; ++camera) r.cameras[camera] = camera_of(gbuffers, camera);
  r.projector_depth = gbuffers.projector_depth ? memory_.address(*gbuffers.projector_depth) : 0;
  r.projector_inverse = memory_.address(*projector_inverse_);
  r.power = power_.address();
  r.ambient = ambient_.address();
  r.errors = memory_.address(*errors_);
  r.material_places = places_.address();
  r.measured_albedo = measured_.address();
  r.between = memory_.address(*matt_);
  r.middles = memory_.address(*lobes_);
  r.matt = memory_.address(*matt_);
  r.lobes = memory_.address(*lobes_);
  r.laser = memory_.address(*laser_);
  r.room = memory_.address(*matt_);
  r.lobe_pixels = memory_.address(*lobe_pixels_);
  r.cells = memory_.address(*cells_);
  r.outputs = frame.outputs();
  r.scene = tables_.address();
  r.pattern = pattern_;
  r.width = launch.width;
  r.height = launch.height;
  r.environments = gbuffers.environments();
  r.materials = materials_ = uint32_t(scene.materials().ids_given()) + 1;
  r.cell_columns = (launch.width + gbuffer_cell_px - 1) / gbuffer_cell_px;
  r.cell_rows = (launch.height + gbuffer_cell_px - 1) / gbuffer_cell_px;
  r.along_rays = gbuffers.along_rays ? 1 : 0;
  r.projector_depth_given = gbuffers.projector_depth ? 1 : 0;
  r.supersampling = gbuffers.supersampling;
  r.laser_as_one = gbuffers.laser_as_one ? 1 : 0;
  r.has_projector = projector_ == nullptr ? 0 : 1;
  r.focal_px = float(left.k[0][0]);
  const glm::dvec3 beside(right.camera_to_world[3] - left.camera_to_world[3]);
  r.baseline_px_m = float(left.k[0][0] * glm::dot(beside, glm::dvec3(left.camera_to_world[0])));
  return r;
}

void GbufferLight::check(const GbufferLaunch& gbuffers) const {
  const std::span<const uint32_t> errors(static_cast<const uint32_t*>(errors_->mapped()), gbuffers.environments());
  std::vector<uint32_t> bad;
  for (uint32_t environment = 0; environment < errors.size(); ++environment)
    if (errors[environment] != gbuffer_no_error) bad.push_back(environment);
  if (bad.empty()) return;
  const uint32_t width = gbuffers.launch.width * gbuffers.supersampling, height = gbuffers.launch.height * gbuffers.supersampling;
  const uint32_t word = errors[bad[0]], pixel = word >> gbuffer_error_bits, image = word >> 2 & 3u;
  const uint64_t at = uint64_t(bad[0]) * width * height + pixel;
  GbufferImages images = image == 2 ? GbufferImages{.depth = gbuffers.projector_depth} : gbuffers.given[image];
  constexpr const char* whose[] = {"", "right ", "projector's "};
  std::string others;
  for (size_t i = 1; i < std::min(bad.size(), most_named + 1); ++i)
    others += (i == 1 ? " (and in environments " : ", ") + std::to_string(bad[i]);
  if (!others.empty()) others += bad.size() > most_named + 1 ? ", ...)" : ")";
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "environment %u, pixel (%u, %u): %s%s%s", bad[0], pixel % width, pixel / width, whose[image],
           complaint(images, word & 3u, at, materials_).c_str(), others.c_str());
}

}  // namespace kuafu
