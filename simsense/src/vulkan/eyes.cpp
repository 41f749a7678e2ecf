#include "vulkan/eyes.h"

#include "spirv/copy.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

uint32_t counts_format(bool wide) { return wide ? KS_FORMAT_U16 : KS_FORMAT_U8; }

/// The image where it can serve as the matcher's array.
std::optional<ImageRef> packed_ref(const std::optional<DeviceImage>& image, const Pairs& pairs, uint32_t format) {
  if (!image || image->format() != format || !image->is_packed()) return std::nullopt;
  return image->ref(pairs.first);
}

ImageRef ref_or_none(const std::optional<DeviceImage>& image, const Pairs& pairs) { return image ? image->ref(pairs.first) : ImageRef{}; }

}  // namespace

VulkanEyes::VulkanEyes(std::shared_ptr<ks::Device> device, uint32_t width, uint32_t height, const VulkanRectifier* rectifier)
    : device_(std::move(device)), width_(width), height_(height), rectifier_(rectifier) {}

ImageRef VulkanEyes::scratch(std::shared_ptr<ks::Buffer>& buffer, uint32_t pairs, bool wide) {
  const uint64_t pixels = uint64_t{width_} * height_, bytes = pixels * pairs * (wide ? 2 : 1);
  if (!buffer || buffer->size_bytes() < bytes) buffer = ks::Buffer::create(device_, bytes, 0);
  return {buffer->address(), counts_format(wide), 0, static_cast<int>(pixels), static_cast<int>(width_), 1, 0};
}

void VulkanEyes::copy(ks::Commands& commands, const ImageRef& from, const ImageRef& to, uint32_t pairs) {
  if (!copy_) copy_.emplace(device_, copy_spirv, sizeof(RemapPush));
  RemapPush push{};
  push.source = from;
  push.target = to;
  push.width = width_;
  push.height = height_;
  dispatch_pixels(commands, *copy_, push, width_, height_, pairs);
}

/// The image as the imager gives it.
ImageRef VulkanEyes::measure(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, uint32_t eye, const Settings& settings,
                             std::span<const NoiseKey> keys) {
  const auto& ir_image = frame.outputs[SIMSENSE_OUTPUT_IR_LEFT + eye];
  const LightRefs light{frame.inputs[eye]->ref(pairs.first), ref_or_none(frame.lasers[eye], pairs)};
  const ImageRef ir = ref_or_none(ir_image, pairs);
  const auto unchanged = packed_ref(frame.inputs[eye], pairs, KS_FORMAT_U8);
  if (settings.imagers[eye].is_neutral() && !settings.wide && unchanged) {
    if (ir.format) copy(commands, light.all, ir, pairs.count);
    return *unchanged;
  }
  const auto in_place = packed_ref(ir_image, pairs, counts_format(settings.wide));
  const ImageRef counts = in_place ? *in_place : scratch(counts_[eye], pairs.count, settings.wide);
  if (!imagers_) imagers_.emplace(device_, width_, height_);
  imagers_->record(commands, eye, settings.imagers[eye], keys, light, counts, in_place ? ImageRef{} : ir);
  return counts;
}

ImageRef VulkanEyes::record(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, uint32_t eye, const Settings& settings,
                            std::span<const NoiseKey> keys) {
  commands.begin_stage("signal");
  const ImageRef counts = measure(commands, frame, pairs, eye, settings, keys);
  const auto& output = frame.outputs[SIMSENSE_OUTPUT_RECTIFIED_LEFT + eye];
  commands.begin_stage("rectify");
  if (!rectifier_) {
    if (output) copy(commands, counts, output->ref(pairs.first), pairs.count);
    return counts;
  }
  const auto in_place = packed_ref(output, pairs, counts_format(settings.wide));
  const ImageRef rectified = in_place ? *in_place : scratch(rectified_[eye], pairs.count, settings.wide);
  rectifier_->record(commands, eye, settings.nearest, counts, rectified, in_place ? ImageRef{} : ref_or_none(output, pairs), pairs.count);
  return rectified;
}

uint64_t VulkanEyes::memory_bytes() const {
  uint64_t bytes = imagers_ ? imagers_->memory_bytes() : 0;
  for (const auto* buffer : {&counts_[0], &counts_[1], &rectified_[0], &rectified_[1]})
    if (*buffer) bytes += (*buffer)->size_bytes();
  return bytes;
}

}  // namespace simsense
