// SPDX-License-Identifier: Apache-2.0
#include "vulkan/rectify/remap.h"

#include "spirv/remap.h"
#include "vulkan/dispatch.h"

namespace simsense {

VulkanRemap::VulkanRemap(const std::shared_ptr<ks::Device>& device, const Rectification& rectification)
    : width_(rectification.left.width),
      height_(rectification.left.height),
      tables_{{upload(device, rectification.left.x), upload(device, rectification.left.y)},
              {upload(device, rectification.right.x), upload(device, rectification.right.y)}},
      remap_(*device, remap_spirv, sizeof(RemapPush)) {}

void VulkanRemap::record(ks::Commands& commands, uint32_t side, bool nearest, const ImageRef& source, const ImageRef& target,
                         const ImageRef& copy, uint32_t pairs) const {
  RemapPush push{};
  push.source = source;
  push.target = target;
  push.copy = copy;
  push.x = tables_[side].x->address();
  push.y = tables_[side].y->address();
  push.width = width_;
  push.height = height_;
  push.nearest = nearest ? 1 : 0;
  dispatch_pixels(commands, remap_, push, width_, height_, pairs);
}

}  // namespace simsense
