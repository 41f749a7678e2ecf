#include "vulkan/maps.h"

#include "shared/match_push.h"
#include "spirv/copy.h"
#include "spirv/explain.h"
#include "spirv/place.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

/// Address of the first of some pairs where the caller's image may be the stage's own array, else 0.
uint64_t in_place_address(const std::optional<DeviceImage>& image, const Pairs& pairs, uint32_t format) {
  if (!image || image->format() != format || !image->is_packed()) return 0;
  return address_of(image->ref(pairs.first));
}

const ks::ComputePipeline& made(std::optional<ks::ComputePipeline>& slot, const std::shared_ptr<ks::Device>& device,
                                std::span<const uint32_t> code, uint32_t push_bytes) {
  if (!slot) slot.emplace(device, code, push_bytes);
  return *slot;
}

}  // namespace

namespace {

MatchTuning tuning_of(const Matching& matching) {
  MatchTuning tuning;
  if (matching.low_memory) tuning.pairs_at_once = 1, tuning.block_costs = BlockCosts::summed;
  return tuning;
}

}  // namespace

VulkanMaps::VulkanMaps(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, uint32_t batch, const Matching& matching)
    : device_(std::move(device)),
      width_(width),
      height_(height),
      whole_{0, 0, width, height},
      matching_(matching),
      matcher_(make_vulkan_matcher(device_, matching.used.x1 - matching.used.x0, matching.used.y1 - matching.used.y0, batch,
                                   matching.parameters, tuning_of(matching))) {}

uint64_t VulkanMaps::reserve(std::shared_ptr<ks::Buffer>& buffer, uint64_t pixel_bytes, uint32_t width, uint32_t height) {
  const uint64_t bytes = pixel_bytes * width * height * pairs_at_once();
  if (!buffer) buffer = ks::Buffer::create(device_, bytes, 0);
  return buffer->address();
}

bool VulkanMaps::is_in_place(const DeviceFrame& frame) {
  return in_place_address(frame.outputs[SIMSENSE_OUTPUT_DISPARITY], {}, KS_FORMAT_F32) != 0;
}

DeviceMaps VulkanMaps::open(const DeviceFrame& frame, const Pairs& pairs) {
  const auto map = [&](uint32_t output, uint32_t format, std::shared_ptr<ks::Buffer>& own) {
    const uint64_t in_place = in_place_address(frame.outputs[output], pairs, format);
    return in_place ? in_place : reserve(own, ks_format_bytes(format), width_, height_);
  };
  DeviceMaps maps;
  maps.disparity = map(SIMSENSE_OUTPUT_DISPARITY, KS_FORMAT_F32, disparity_);
  if (frame.wants(SIMSENSE_OUTPUT_CONFIDENCE)) maps.confidence = map(SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32, confidence_);
  if (frame.wants(SIMSENSE_OUTPUT_REASON)) maps.reason = map(SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8, reason_);
  return maps;
}

/// What the matcher reads and writes: the maps themselves, or those of the part it sees.
MatchArrays VulkanMaps::match_arrays(const ImageRef (&images)[2], const DeviceMaps& maps) {
  const Region& used = matching_.used;
  const uint32_t part_width = used.x1 - used.x0, part_height = used.y1 - used.y0;
  MatchArrays arrays;
  arrays.element_bytes = ks_format_bytes(images[0].format);
  const uint64_t first = uint64_t{used.y0} * width_ + used.x0;
  arrays.left = address_of(images[0]) + first * arrays.element_bytes;
  arrays.right = address_of(images[1]) + first * arrays.element_bytes;
  arrays.image_pitch = width_;
  arrays.image_stride = width_ * height_;
  arrays.disparity = maps.disparity;
  arrays.confidence = maps.confidence;
  arrays.reason = maps.reason;
  if (!is_partial()) return arrays;
  arrays.disparity = reserve(part_disparity_, sizeof(float), part_width, part_height);
  if (maps.confidence) arrays.confidence = reserve(part_confidence_, sizeof(float), part_width, part_height);
  if (maps.reason) arrays.reason = reserve(part_reason_, 1, part_width, part_height);
  return arrays;
}

void VulkanMaps::place(ks::Commands& commands, const MatchArrays& part, const DeviceMaps& maps, uint32_t pairs) {
  const Region &used = matching_.used, &wanted = matching_.wanted;
  PlacePush push{};
  push.part_disparity = part.disparity;
  push.part_confidence = part.confidence;
  push.part_reason = part.reason;
  push.disparity = maps.disparity;
  push.confidence = maps.confidence;
  push.reason = maps.reason;
  push.part_width = used.x1 - used.x0;
  push.part_height = used.y1 - used.y0;
  push.part_x = used.x0;
  push.part_y = used.y0;
  push.width = width_;
  push.height = height_;
  push.x0 = wanted.x0;
  push.y0 = wanted.y0;
  push.x1 = wanted.x1;
  push.y1 = wanted.y1;
  push.maps = (maps.confidence ? MATCH_CONFIDENCE : 0u) | (maps.reason ? MATCH_REASON : 0u);
  push.invalid = matching_.parameters.invalid_disparity();
  dispatch_pixels(commands, made(place_, device_, place_spirv, sizeof push), push, width_, height_, pairs);
}

void VulkanMaps::record_match(ks::Commands& commands, const ImageRef (&images)[2], const DeviceMaps& maps, uint32_t pairs) {
  const MatchArrays arrays = match_arrays(images, maps);
  matcher_->record(commands, arrays, pairs);
  if (is_partial()) place(commands, arrays, maps, pairs);
}

void VulkanMaps::record_explanation(ks::Commands& commands, const ExplainRequest& request, const ImageRef& left, const DeviceMaps& maps,
                                    uint32_t pairs) {
  ExplainPush push{};
  push.block = request.depth_block;
  push.disparity = maps.disparity;
  push.reason = maps.reason;
  push.left = left;
  push.window_width = request.window_width;
  push.window_height = request.window_height;
  push.low_texture_dn = request.low_texture_dn;
  push.saturated_dn = request.saturated_dn;
  commands.begin_stage("reason");
  dispatch_pixels(commands, made(explain_, device_, explain_spirv, sizeof push), push, width_, height_, pairs);
}

void VulkanMaps::record_copies(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const DeviceMaps& maps) {
  const auto copy = [&](uint32_t output, uint32_t format, uint64_t address) {
    if (!address || in_place_address(frame.outputs[output], pairs, format)) return;
    RemapPush push{};
    push.source = {address, format, 0, static_cast<int>(width_ * height_), static_cast<int>(width_), 1, 0};
    push.target = frame.outputs[output]->ref(pairs.first);
    push.width = width_;
    push.height = height_;
    dispatch_pixels(commands, made(copy_, device_, copy_spirv, sizeof push), push, width_, height_, pairs.count);
  };
  copy(SIMSENSE_OUTPUT_CONFIDENCE, KS_FORMAT_F32, maps.confidence);
  copy(SIMSENSE_OUTPUT_REASON, KS_FORMAT_U8, maps.reason);
}

uint64_t VulkanMaps::memory_bytes() const {
  uint64_t bytes = matcher_->memory_bytes();
  for (const auto* buffer : {&disparity_, &confidence_, &reason_, &part_disparity_, &part_confidence_, &part_reason_})
    if (*buffer) bytes += (*buffer)->size_bytes();
  return bytes;
}

}  // namespace simsense
