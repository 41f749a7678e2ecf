// SPDX-License-Identifier: Apache-2.0
#include "vulkan/stages.h"

#include <algorithm>

#include "spirv/copy.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

uint32_t counts_format(bool wide) { return wide ? KS_FORMAT_U16 : KS_FORMAT_U8; }

MatchTuning tuning_of(const StageSettings& settings) {
  MatchTuning tuning;
  if (settings.low_memory) tuning.pairs_at_once = 1, tuning.block_costs = BlockCosts::summed;
  return tuning;
}

}  // namespace

VulkanStages::VulkanStages(std::shared_ptr<ks::Device> device, const PreparedRig& rig)
    : device_(std::move(device)),
      rig_(rig),
      width_(rig.width()),
      height_(rig.height()),
      checks_(device_, width_, height_),
      remap_(rig.rectification.is_identity() ? nullptr : std::make_unique<VulkanRemap>(device_, rig.rectification)) {}

bool VulkanStages::keeps_arrays(const StageSettings& settings) const {
  return matching_ == Matching{settings.match, settings.wanted, settings.used};
}

void VulkanStages::prepare(const StageSettings& settings, const Needs& needs) {
  if (!keeps_arrays(settings)) {
    match_maps_.reset();
    matcher_.reset();
  }
  matching_ = {settings.match, settings.wanted, settings.used};
  if (!needs.disparity) return;
  if (!matcher_) {
    const Region& used = settings.used;
    matcher_ =
        make_vulkan_matcher(device_, used.x1 - used.x0, used.y1 - used.y0, rig_.rig.batch_count, settings.match, tuning_of(settings));
    match_maps_.emplace(device_, width_, height_, settings, pairs_at_once());
  }
  if (!depth_) depth_.emplace(device_, rig_);
  if (rig_.rgb && !registration_) registration_.emplace(device_, *depth_);
}

void VulkanStages::begin(ks::Commands& commands, const StageSettings& settings) {
  if (depth_) depth_->begin(commands, settings);
}

uint32_t VulkanStages::pairs_at_once() const {
  return std::min(matcher_ ? matcher_->plan().pairs_at_once : rig_.rig.batch_count, signal_pairs);
}

void VulkanStages::record(ks::Commands& commands, const StageSettings& settings, const DeviceFrame& frame, const Pairs& pairs) {
  call_.emplace(Call{commands, settings, frame, pairs});
  run_stages(*this, settings, {frame, rig_.rgb.has_value()});
}

void VulkanStages::measure(const char* name, const std::function<void()>& run) {
  call_->commands.begin_stage(name);
  run();
}

ImageRef VulkanStages::scratch(std::shared_ptr<ks::Buffer>& buffer) {
  const bool wide = call_->settings.wide;
  reserve(device_, buffer, rig_.pixels() * call_->pairs.count * (wide ? 2 : 1));
  return {buffer->address(), counts_format(wide), 0, static_cast<int>(rig_.pixels()), static_cast<int>(width_), 1, 0};
}

void VulkanStages::copy(const ImageRef& from, const ImageRef& to) {
  if (!copy_) copy_.emplace(*device_, copy_spirv, sizeof(CopyPush));
  CopyPush push{};
  push.source = from;
  push.target = to;
  push.width = width_;
  push.height = height_;
  push.extra_bits = from.format == KS_FORMAT_U16 && to.format == KS_FORMAT_U8 ? call_->settings.extra_bits : 0;
  dispatch_pixels(call_->commands, *copy_, push, width_, height_, call_->pairs.count);
}

void VulkanStages::signal() {
  for (const uint32_t side : {0u, 1u}) images_[side] = measure_side(side);
}

/// The image as the imager gives it.
ImageRef VulkanStages::measure_side(uint32_t side) {
  const auto& [commands, settings, frame, pairs] = *call_;
  const auto& ir_image = frame.outputs[SIMSENSE_OUTPUT_IR_LEFT + side];
  const LightRefs light{frame.inputs[side]->ref(pairs.first), ref_or_none(frame.lasers[side], pairs)};
  const ImageRef ir = ref_or_none(ir_image, pairs);
  const auto unchanged = packed_ref(frame.inputs[side], pairs, KS_FORMAT_U8);
  if (settings.imagers[side].is_neutral() && !settings.wide && unchanged) {
    if (ir.format) copy(light.all, ir);
    return *unchanged;
  }
  const auto in_place = packed_ref(ir_image, pairs, counts_format(settings.wide));
  const ImageRef counts = in_place ? *in_place : scratch(counts_[side]);
  if (!imagers_) imagers_.emplace(device_, width_, height_);
  std::vector<NoiseKey> keys;
  for (uint32_t n = pairs.first; n < pairs.first + pairs.count; ++n) keys.push_back(settings.noise_key(n, side));
  const bool is_rounded = settings.extra_bits > 0;
  imagers_->record(commands, side, settings.imagers[side], keys, light, counts, in_place || is_rounded ? ImageRef{} : ir);
  if (is_rounded && ir.format) copy(counts, ir);
  return counts;
}

void VulkanStages::rectify() {
  for (const uint32_t side : {0u, 1u}) images_[side] = rectify_side(side);
}

ImageRef VulkanStages::rectify_side(uint32_t side) {
  const auto& [commands, settings, frame, pairs] = *call_;
  const auto& image = frame.outputs[SIMSENSE_OUTPUT_RECTIFIED_LEFT + side];
  if (!remap_) {
    if (image) copy(images_[side], image->ref(pairs.first));
    return images_[side];
  }
  const auto in_place = packed_ref(image, pairs, counts_format(settings.wide));
  const ImageRef rectified = in_place ? *in_place : scratch(rectified_[side]);
  const bool is_rounded = settings.extra_bits > 0;
  remap_->record(commands, side, settings.remaps_nearest, images_[side], rectified,
                 in_place || is_rounded ? ImageRef{} : ref_or_none(image, pairs), pairs.count);
  if (is_rounded && image) copy(rectified, image->ref(pairs.first));
  return rectified;
}

MatchStages& VulkanStages::matcher() {
  maps_ = match_maps_->open(call_->frame, call_->pairs);
  arrays_ = match_maps_->match_arrays(images_, maps_);
  arrays_.noise = call_->settings.noise;
  matcher_->begin(call_->commands, arrays_, call_->pairs.count);
  return *matcher_;
}

void VulkanStages::place_region() { match_maps_->place(call_->commands, arrays_, maps_, call_->pairs.count); }

void VulkanStages::depth() {
  const ImageRef disparity = VulkanMaps::is_in_place(call_->frame) ? ImageRef{} : output(SIMSENSE_OUTPUT_DISPARITY);
  const ImageRef depth = output(SIMSENSE_OUTPUT_DEPTH), points = rig_.rgb ? ImageRef{} : output(SIMSENSE_OUTPUT_POINTS);
  if (disparity.format || depth.format || points.format)
    depth_->record(call_->commands, maps_.disparity, disparity, depth, points, call_->pairs.count);
}

void VulkanStages::registration() {
  registration_->record(call_->commands, maps_.disparity, output(SIMSENSE_OUTPUT_DEPTH_RGB), output(SIMSENSE_OUTPUT_POINTS),
                        output(SIMSENSE_OUTPUT_POINTS_COLORED), ref_or_none(call_->frame.rgb, call_->pairs), call_->pairs.count);
}

void VulkanStages::store_maps() { match_maps_->store(call_->commands, call_->frame, call_->pairs, maps_); }

uint64_t VulkanStages::memory_bytes() const {
  uint64_t bytes = checks_.memory_bytes() + (imagers_ ? imagers_->memory_bytes() : 0) + (matcher_ ? matcher_->memory_bytes() : 0) +
                   (match_maps_ ? match_maps_->memory_bytes() : 0) + (registration_ ? registration_->memory_bytes() : 0);
  for (const auto* buffer : {&counts_[0], &counts_[1], &rectified_[0], &rectified_[1]})
    if (*buffer) bytes += (*buffer)->size_bytes();
  return bytes;
}

}  // namespace simsense
