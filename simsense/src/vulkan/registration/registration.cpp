// SPDX-License-Identifier: Apache-2.0
#include "vulkan/registration/registration.h"

#include <algorithm>

#include "spirv/resolve.h"
#include "spirv/splat.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

constexpr uint64_t most_cell_bytes = 64ull << 20;  // of the z-buffers that are filled side by side
constexpr uint32_t nothing = 0x7f800000;           // bits of +infinity

}  // namespace

VulkanRegistration::VulkanRegistration(std::shared_ptr<ks::Device> device, const VulkanDepth& depth)
    : device_(std::move(device)),
      depth_(depth),
      splat_(*device_, splat_spirv, sizeof(DepthPush)),
      resolve_(*device_, resolve_spirv, sizeof(DepthPush)) {}

void VulkanRegistration::record(ks::Commands& commands, uint64_t disparity, const ImageRef& depth, const ImageRef& points,
                                const ImageRef& colored, const ImageRef& rgb, uint32_t pairs) {
  const DepthParameters& p = depth_.parameters();
  const uint64_t cell_bytes = uint64_t{p.rgb_width + 2 * SPLAT_MARGIN} * (p.rgb_height + 2 * SPLAT_MARGIN) * sizeof(uint32_t);
  const auto at_once = static_cast<uint32_t>(std::clamp<uint64_t>(most_cell_bytes / cell_bytes, 1, pairs));
  reserve(device_, nearest_, cell_bytes * at_once);
  for (uint32_t n = 0; n < pairs; n += at_once) {
    const uint32_t count = std::min(at_once, pairs - n);
    const auto later = [n](const ImageRef& image) { return later_image(image, n); };
    DepthPush push{depth_.block(), disparity + uint64_t{n} * p.width * p.height * sizeof(float), nearest_->address(), {}, {}, {}};
    commands.fill(*nearest_, 0, cell_bytes * count, nothing);
    dispatch_pixels(commands, splat_, push, p.width, p.height, count);
    push.first = later(depth);
    push.second = later(points);
    if (depth.format || points.format) dispatch_pixels(commands, resolve_, push, p.rgb_width, p.rgb_height, count);
    push.first = {};
    push.second = later(colored);
    push.third = later(rgb);
    if (colored.format) dispatch_pixels(commands, resolve_, push, p.rgb_width, p.rgb_height, count);
  }
}

}  // namespace simsense
