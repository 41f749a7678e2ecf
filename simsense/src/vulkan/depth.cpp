#include "vulkan/depth.h"

#include <algorithm>

#include "spirv/depth.h"
#include "spirv/resolve.h"
#include "spirv/splat.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

constexpr uint64_t most_cell_bytes = 64ull << 20;  // of the z-buffers that are filled side by side
constexpr uint32_t nothing = 0x7f800000;           // bits of +infinity

std::shared_ptr<ks::Buffer> upload(const std::shared_ptr<ks::Device>& device, const std::vector<float>& values) {
  auto buffer = ks::Buffer::create(device, values.size() * sizeof(float), 0);
  buffer->write(0, values.data(), values.size() * sizeof(float));
  return buffer;
}

std::vector<float> row_starts(const Registration& registration, uint32_t height) {
  std::vector<float> starts;
  for (uint32_t y = 0; y < height; ++y) std::ranges::copy(registration.ray_start(y), std::back_inserter(starts));
  return starts;
}

void set_rgb_camera(DepthParameters& p, const simsense_camera& rgb, const Registration& registration) {
  std::ranges::copy(registration.ray_step(), p.step);
  std::ranges::copy(registration.translation(), p.translation_m);
  p.splat_invalid = registration.splats_invalid() ? 1 : 0;
  p.landing_margin = static_cast<float>(registration.landing_margin());
  p.rgb_width = rgb.width;
  p.rgb_height = rgb.height;
  p.rgb_focal[0] = static_cast<float>(rgb.k[0]);
  p.rgb_focal[1] = static_cast<float>(rgb.k[4]);
  p.rgb_centre[0] = static_cast<float>(rgb.k[2]);
  p.rgb_centre[1] = static_cast<float>(rgb.k[5]);
  if (!registration.distortion()) return;
  const auto [k1, k2, k3, p1, p2, max_radius2] = registration.distortion()->coefficients();
  p.k1 = k1, p.k2 = k2, p.k3 = k3, p.p1 = p1, p.p2 = p2, p.max_radius2 = max_radius2;
}

}  // namespace

VulkanDepth::VulkanDepth(std::shared_ptr<ks::Device> device, const simsense_rig_desc& rig, const StereoGeometry& geometry,
                         const Registration* registration, const PointMaker& points)
    : device_(std::move(device)),
      block_(ks::Buffer::create(device_, sizeof(DepthParameters), 0)),
      ray_x_(upload(device_, points.ray_x())),
      ray_y_(upload(device_, points.ray_y())),
      depth_(device_, depth_spirv, sizeof(DepthPush)) {
  DepthParameters& p = parameters_;
  p.ray_x = ray_x_->address();
  p.ray_y = ray_y_->address();
  p.rays_per_pixel = points.has_ray_per_pixel() ? 1 : 0;
  p.width = rig.left.width;
  p.height = rig.left.height;
  p.focal_baseline = static_cast<float>(geometry.camera.fx * geometry.baseline_m);
  p.offset_px = static_cast<float>(geometry.disparity_offset_px);
  if (!registration) return;
  row_starts_ = upload(device_, row_starts(*registration, p.height));
  p.row_starts = row_starts_->address();
  set_rgb_camera(p, rig.rgb, *registration);
  splat_.emplace(device_, splat_spirv, sizeof(DepthPush));
  resolve_.emplace(device_, resolve_spirv, sizeof(DepthPush));
}

void VulkanDepth::begin(ks::Commands& commands, const DepthRequest& request) {
  parameters_.invalid = request.invalid_disparity;
  parameters_.min_m = request.range.min_m;
  parameters_.max_m = request.range.max_m;
  parameters_.splat_size = request.splat_size;
  commands.update(*block_, 0, &parameters_, sizeof parameters_);
}

void VulkanDepth::record_left(ks::Commands& commands, uint64_t disparity, const ImageRef& disparity_out, const ImageRef& depth,
                              const ImageRef& points, uint32_t pairs) const {
  const DepthPush push{block_->address(), disparity, 0, disparity_out, depth, points};
  dispatch_pixels(commands, depth_, push, parameters_.width, parameters_.height, pairs);
}

void VulkanDepth::record_rgb(ks::Commands& commands, uint64_t disparity, const ImageRef& depth, const ImageRef& points,
                             const ImageRef& colored, const ImageRef& rgb, uint32_t pairs) {
  const DepthParameters& p = parameters_;
  const uint64_t cell_bytes = uint64_t{p.rgb_width + 2 * SPLAT_MARGIN} * (p.rgb_height + 2 * SPLAT_MARGIN) * sizeof(uint32_t);
  const auto at_once = static_cast<uint32_t>(std::clamp<uint64_t>(most_cell_bytes / cell_bytes, 1, pairs));
  if (!nearest_ || nearest_->size_bytes() < cell_bytes * at_once) nearest_ = ks::Buffer::create(device_, cell_bytes * at_once, 0);
  for (uint32_t n = 0; n < pairs; n += at_once) {
    const uint32_t count = std::min(at_once, pairs - n);
    const auto later = [n](const ImageRef& image) { return later_image(image, n); };
    DepthPush push{block_->address(), disparity + uint64_t{n} * p.width * p.height * sizeof(float), nearest_->address(), {}, {}, {}};
    commands.fill(*nearest_, 0, cell_bytes * count, nothing);
    dispatch_pixels(commands, *splat_, push, p.width, p.height, count);
    push.first = later(depth);
    push.second = later(points);
    if (depth.format || points.format) dispatch_pixels(commands, *resolve_, push, p.rgb_width, p.rgb_height, count);
    push.first = {};
    push.second = later(colored);
    push.third = later(rgb);
    if (colored.format) dispatch_pixels(commands, *resolve_, push, p.rgb_width, p.rgb_height, count);
  }
}

}  // namespace simsense
