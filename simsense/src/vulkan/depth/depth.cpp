// SPDX-License-Identifier: Apache-2.0
#include "vulkan/depth/depth.h"

#include <algorithm>

#include "spirv/depth.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

std::vector<float> row_starts(const RgbProjection& projection, uint32_t height) {
  std::vector<float> starts;
  for (uint32_t y = 0; y < height; ++y) std::ranges::copy(projection.ray_start(y), std::back_inserter(starts));
  return starts;
}

void set_rgb_camera(DepthParameters& p, const RgbProjection& projection) {
  std::ranges::copy(projection.ray_step(), p.step);
  std::ranges::copy(projection.translation(), p.translation_m);
  p.splat_invalid = projection.splats_invalid() ? 1 : 0;
  p.landing_margin = static_cast<float>(projection.landing_margin());
  p.rgb_width = projection.width();
  p.rgb_height = projection.height();
  std::ranges::copy(projection.focal_px(), p.rgb_focal);
  std::ranges::copy(projection.centre_px(), p.rgb_centre);
  p.lens = projection.lens();
}

}  // namespace

VulkanDepth::VulkanDepth(std::shared_ptr<ks::Device> device, const PreparedRig& rig)
    : device_(std::move(device)),
      block_(ks::Buffer::create(device_, sizeof(DepthParameters), 0)),
      ray_x_(upload(device_, rig.rays.x())),
      ray_y_(upload(device_, rig.rays.y())),
      pipeline_(*device_, depth_spirv, sizeof(DepthPush)) {
  const StereoGeometry& geometry = rig.rectification.geometry;
  DepthParameters& p = parameters_;
  p.ray_x = ray_x_->address();
  p.ray_y = ray_y_->address();
  p.rays_per_pixel = rig.rays.is_per_pixel() ? 1 : 0;
  p.width = rig.width();
  p.height = rig.height();
  p.focal_baseline = static_cast<float>(geometry.camera.fx * geometry.baseline_m);
  p.offset_px = static_cast<float>(geometry.disparity_offset_px);
  if (!rig.rgb) return;
  row_starts_ = upload(device_, row_starts(*rig.rgb, p.height));
  p.row_starts = row_starts_->address();
  set_rgb_camera(p, *rig.rgb);
}

void VulkanDepth::begin(ks::Commands& commands, const StageSettings& settings) {
  parameters_.invalid = settings.invalid_disparity();
  parameters_.min_m = settings.depth_range.min_m;
  parameters_.max_m = settings.depth_range.max_m;
  parameters_.splat_size = settings.splat.size;
  parameters_.splat_reach = settings.splat.reach();
  commands.update(*block_, 0, &parameters_, sizeof parameters_);
}

void VulkanDepth::record(ks::Commands& commands, uint64_t disparity, const ImageRef& disparity_out, const ImageRef& depth,
                         const ImageRef& points, uint32_t pairs) const {
  const DepthPush push{block_->address(), disparity, 0, disparity_out, depth, points};
  dispatch_pixels(commands, pipeline_, push, parameters_.width, parameters_.height, pairs);
}

}  // namespace simsense
