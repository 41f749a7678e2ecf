// SPDX-License-Identifier: Apache-2.0
#include "vulkan/maps.h"

#include "shared/map_push.h"
#include "shared/remap_push.h"
#include "spirv/copy.h"
#include "spirv/place.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

/// Address of the first of some pairs where the caller's image may be the stage's own array, else 0.
uint64_t in_place_address(const std::optional<DeviceImage>& image, const Pairs& pairs, uint32_t format) {
  const std::optional<ImageRef> packed = packed_ref(image, pairs, format);
  return packed ? address_of(*packed) : 0;
}

const ks::ComputePipeline& made(std::optional<ks::ComputePipeline>& slot, const std::shared_ptr<ks::Device>& device,
                                std::span<const uint32_t> code, uint32_t push_bytes) {
  if (!slot) slot.emplace(*device, code, push_bytes);
  return *slot;
}

}  // namespace

VulkanMaps::VulkanMaps(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, const StageSettings& settings,
                       uint32_t pairs_at_once)
    : device_(std::move(device)),
      width_(width),
      height_(height),
      wanted_(settings.wanted),
      used_(settings.used),
      is_partial_(settings.is_partial),
      invalid_(settings.invalid_disparity()),
      pairs_at_once_(pairs_at_once) {}

uint64_t VulkanMaps::address_in(std::shared_ptr<ks::Buffer>& buffer, uint64_t pixel_bytes, uint32_t width, uint32_t height) {
  if (!buffer) buffer = ks::Buffer::create(device_, pixel_bytes * width * height * pairs_at_once_, 0);
  return buffer->address();
}

bool VulkanMaps::is_in_place(const DeviceFrame& frame) {
  return in_place_address(frame.outputs[SIMSENSE_OUTPUT_DISPARITY], {}, KS_FORMAT_F32) != 0;
}

DeviceMaps VulkanMaps::open(const DeviceFrame& frame, const Pairs& pairs) {
  const auto map = [&](uint32_t output, uint32_t format, std::shared_ptr<ks::Buffer>& own) {
    const uint64_t in_place = in_place_address(frame.outputs[output], pairs, format);
    return in_place ? in_place : address_in(own, ks_format_bytes(format), width_, height_);
  };
  DeviceMaps maps;
  maps.disparity = map(SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32, disparity_);
  if (frame.wants(SIMSENSE_OUTPUT_CONFIDENCE)) maps.confidence = map(SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32, confidence_);
  if (frame.wants(SIMSENSE_OUTPUT_REASON)) maps.reason = map(SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8, reason_);
  return maps;
}

MatchArrays VulkanMaps::match_arrays(const ImageRef (&images)[2], const DeviceMaps& maps) {
  const uint32_t part_width = used_.x1 - used_.x0, part_height = used_.y1 - used_.y0;
  MatchArrays arrays;
  arrays.element_bytes = ks_format_bytes(images[0].format);
  const uint64_t first = uint64_t{used_.y0} * width_ + used_.x0;
  arrays.left = address_of(images[0]) + first * arrays.element_bytes;
  arrays.right = address_of(images[1]) + first * arrays.element_bytes;
  arrays.image_pitch = width_;
  arrays.image_stride = width_ * height_;
  arrays.disparity = maps.disparity;
  arrays.confidence = maps.confidence;
  arrays.reason = maps.reason;
  if (!is_partial_) return arrays;
  arrays.disparity = address_in(part_disparity_, sizeof(float), part_width, part_height);
  if (maps.confidence) arrays.confidence = address_in(part_confidence_, sizeof(float), part_width, part_height);
  if (maps.reason) arrays.reason = address_in(part_reason_, 1, part_width, part_height);
  return arrays;
}

void VulkanMaps::place(ks::Commands& commands, const MatchArrays& part, const DeviceMaps& maps, uint32_t pairs) {
  PlacePush push{};
  push.part_disparity = part.disparity;
  push.part_confidence = part.confidence;
  push.part_reason = part.reason;
  push.disparity = maps.disparity;
  push.confidence = maps.confidence;
  push.reason = maps.reason;
  push.part_width = used_.x1 - used_.x0;
  push.part_height = used_.y1 - used_.y0;
  push.part_x = used_.x0;
  push.part_y = used_.y0;
  push.width = width_;
  push.height = height_;
  push.x0 = wanted_.x0;
  push.y0 = wanted_.y0;
  push.x1 = wanted_.x1;
  push.y1 = wanted_.y1;
  push.maps = maps.flags();
  push.invalid = invalid_;
  dispatch_pixels(commands, made(place_, device_, place_spirv, sizeof push), push, width_, height_, pairs);
}

void VulkanMaps::store(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const DeviceMaps& maps) {
  const auto copy = [&](uint32_t output, uint32_t format, uint64_t address) {
    if (!address || in_place_address(frame.outputs[output], pairs, format)) return;
    CopyPush push{};
    push.source = {.address = address,
                   .format = format,
                   .first = 0,
                   .batch_stride = static_cast<int>(width_ * height_),
                   .row_stride = static_cast<int>(width_),
                   .pixel_stride = 1,
                   .component_stride = 0};
    push.target = frame.outputs[output]->ref(pairs.first);
    push.width = width_;
    push.height = height_;
    dispatch_pixels(commands, made(copy_, device_, copy_spirv, sizeof push), push, width_, height_, pairs.count);
  };
  copy(SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32, maps.confidence);
  copy(SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8, maps.reason);
}

uint64_t VulkanMaps::memory_bytes() const {
  uint64_t bytes = 0;
  for (const auto* buffer : {&disparity_, &confidence_, &reason_, &part_disparity_, &part_confidence_, &part_reason_})
    if (*buffer) bytes += (*buffer)->size_bytes();
  return bytes;
}

}  // namespace simsense
