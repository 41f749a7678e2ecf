#include "vulkan/pipeline.h"

#include <algorithm>

#include "device/error.h"
#include "parameters/parameters.h"
#include "vulkan/dispatch.h"

namespace simsense {
namespace {

constexpr size_t slot_count = 2;

ImageRef ref_or_none(const DeviceFrame& frame, uint32_t output, const Pairs& pairs) {
  return frame.wants(output) ? frame.outputs[output]->ref(pairs.first) : ImageRef{};
}

template <class F>
void each_host_output(DeviceFrame& frame, const F& f) {
  for (auto& output : frame.outputs)
    if (output && output->is_host()) f(*output);
}

std::vector<NoiseKey> noise_keys(const simsense_parameters& p, const simsense_signal& s, const Pairs& pairs, uint32_t eye) {
  std::vector<NoiseKey> keys;
  for (uint32_t n = pairs.first; n < pairs.first + pairs.count; ++n)
    keys.push_back({p.noise_seed, p.frame_index, s.scene_index, s.first_view + n, eye});
  return keys;
}

CleanRequest clean_request(const simsense_parameters& p, const simsense_rig_desc& rig, const Region& region, bool drop_padding) {
  CleanRequest request;
  request.invalid = match_parameters(p).invalid_disparity();
  request.drop_padding = drop_padding && !(rig.faults & SIMSENSE_FAULT_PADDING_MATCHED);
  request.speckle_max_size = p.speckle_max_size;
  request.speckle_max_diff_px = p.speckle_max_diff_px;
  request.filling = static_cast<HoleFilling>(p.hole_filling);
  request.region = region;
  return request;
}

DepthRequest depth_request(const simsense_parameters& p) {
  return {match_parameters(p).invalid_disparity(), depth_range(p), std::max({1u, p.splat_size, p.depth_dilation != 0 ? 2u : 1u})};
}

}  // namespace

VulkanPipeline::VulkanPipeline(std::shared_ptr<ks::Device> device, const PipelineParts& parts)
    : device_(std::move(device)),
      rig_(parts.rig),
      has_rgb_(parts.rig.rgb.width != 0),
      rectifier_(parts.rectification.is_identity() ? nullptr : std::make_unique<VulkanRectifier>(device_, parts.rectification)),
      eyes_(device_, rig_.left.width, rig_.left.height, rectifier_.get()),
      cleaner_(device_, rig_.left.width, rig_.left.height, rectifier_.get()),
      parts_(parts),
      staging_(device_) {
  if (ks::Timeline::can_have(*device_)) timeline_.emplace(device_);
  while (slots_.size() < slot_count) slots_.push_back(std::make_unique<Slot>(device_));
}

VulkanPipeline::~VulkanPipeline() {
  try {
    wait_idle();
  } catch (const ks::Error&) {
    // The device is lost: nothing runs any more.
  }
}

uint32_t VulkanPipeline::pairs_at_once() const { return maps_ ? maps_->pairs_at_once() : std::min(rig_.batch_count, signal_pairs); }

/// What follows from finished disparities.
void VulkanPipeline::record_outputs(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const DeviceMaps& maps) {
  const auto output = [&](uint32_t which) { return ref_or_none(frame, which, pairs); };
  const ImageRef disparity = VulkanMaps::is_in_place(frame) ? ImageRef{} : output(SIMSENSE_OUTPUT_DISPARITY);
  const ImageRef depth = output(SIMSENSE_OUTPUT_DEPTH), points = output(SIMSENSE_OUTPUT_POINTS);
  if (disparity.format || depth.format || (points.format && !has_rgb_)) {
    commands.begin_stage("depth");
    depth_->record_left(commands, maps.disparity, disparity, depth, has_rgb_ ? ImageRef{} : points, pairs.count);
  }
  if (!has_rgb_ || !(frame.wants(SIMSENSE_OUTPUT_DEPTH_RGB) || frame.wants_points())) return;
  commands.begin_stage("registration");
  depth_->record_rgb(commands, maps.disparity, output(SIMSENSE_OUTPUT_DEPTH_RGB), points, output(SIMSENSE_OUTPUT_POINTS_COLORED),
                     frame.rgb ? frame.rgb->ref(pairs.first) : ImageRef{}, pairs.count);
}

void VulkanPipeline::record_disparity(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs,
                                      const PipelineSettings& settings, const ImageRef (&images)[2]) {
  const simsense_parameters& p = settings.parameters;
  const DeviceMaps maps = maps_->open(frame, pairs);
  maps_->record_match(commands, images, maps, pairs.count);
  cleaner_.record(commands, clean_request(p, rig_, settings.matching.wanted, rectifier_ != nullptr), maps, pairs.count);
  record_outputs(commands, frame, pairs, maps);
  if (maps.reason) {
    const uint32_t saturated_dn = (1u << settings.imagers[0].signal().bit_depth) - 1;
    const ExplainRequest request{depth_->block(), p.census_width, p.census_height, p.low_texture_dn, saturated_dn};
    maps_->record_explanation(commands, request, images[0], maps, pairs.count);
  }
  maps_->record_copies(commands, frame, pairs, maps);
}

void VulkanPipeline::record_pairs(ks::Commands& commands, const DeviceFrame& frame, const Pairs& pairs, const PipelineSettings& settings) {
  const simsense_parameters& p = settings.parameters;
  ImageRef images[2];
  for (uint32_t eye : {0u, 1u})
    images[eye] =
        eyes_.record(commands, frame, pairs, eye, {settings.imagers, settings.wide, (rig_.faults & SIMSENSE_FAULT_REMAP_NEAREST) != 0},
                     noise_keys(p, settings.imagers[eye].signal(), pairs, eye));
  if (frame.wants_disparity()) record_disparity(commands, frame, pairs, settings, images);
}

void VulkanPipeline::record(ks::Commands& commands, const DeviceFrame& frame, const PipelineSettings& settings) {
  if (!(settings.matching == matching_)) maps_.reset();  // nothing is under way, see submit()
  matching_ = settings.matching;
  if (frame.wants_disparity() && !maps_)
    maps_ = std::make_unique<VulkanMaps>(device_, rig_.left.width, rig_.left.height, rig_.batch_count, matching_);
  if (frame.wants_disparity() && !depth_) depth_.emplace(device_, rig_, parts_.rectification.geometry, parts_.registration, parts_.points);
  commands.reset_stage_times();
  commands.begin_stage("signal");
  commands.barrier();  // after what is under way: both use the same arrays
  if (depth_) depth_->begin(commands, depth_request(settings.parameters));
  for (uint32_t n = 0; n < rig_.batch_count; n += pairs_at_once()) {
    const float share = static_cast<float>(n) / static_cast<float>(rig_.batch_count);
    if (settings.progress && settings.progress(settings.progress_user, share))
      ks::fail(KS_ERROR_CANCELLED, "cancelled by the progress callback before pair %u of %u", n + 1, rig_.batch_count);
    record_pairs(commands, frame, {n, std::min(pairs_at_once(), rig_.batch_count - n)}, settings);
  }
}

uint64_t VulkanPipeline::submit(DeviceFrame frame, const PipelineSettings& settings) {
  uint64_t outputs = 0;
  for (uint32_t i = 0; i < output_count; ++i) outputs |= uint64_t{frame.wants(i)} << i;
  if (outputs != recorded_outputs_ || !(settings.matching == matching_)) wait_idle();  // arrays may change
  recorded_outputs_ = outputs;
  std::unique_ptr<Slot>& slot = slots_[submitted_ % slot_count];
  if (slot->number) wait(slot->number);
  for (auto* image : {&frame.inputs[0], &frame.inputs[1], &frame.lasers[0], &frame.lasers[1], &frame.rgb})
    if (*image) (*image)->load();
  slot->frame.emplace(std::move(frame));
  try {
    record(slot->commands, *slot->frame, settings);
    if (timeline_) {
      slot->commands.submit(*timeline_, submitted_ + 1);
    } else {
      slot->commands.flush();
    }
  } catch (...) {
    wait_idle();
    slot = std::make_unique<Slot>(device_);
    eyes_.discard();
    throw;
  }
  slot->number = ++submitted_;
  return submitted_;
}

void VulkanPipeline::finish(Slot& slot) {
  if (timeline_) timeline_->wait(slot.number);
  slot.number = 0;
  slot.commands.finish();
  stage_times_ = slot.commands.stage_times();
  each_host_output(*slot.frame, [](DeviceImage& image) { image.commit(); });
  slot.frame.reset();
}

void VulkanPipeline::wait(uint64_t submission) {
  for (uint64_t number = submission > slot_count ? submission - slot_count + 1 : 1; number <= submission; ++number) {
    Slot& slot = *slots_[(number - 1) % slot_count];
    if (slot.number == number) finish(slot);
  }
}

uint64_t VulkanPipeline::memory_bytes() const {
  return eyes_.memory_bytes() + cleaner_.memory_bytes() + (depth_ ? depth_->memory_bytes() : 0) + (maps_ ? maps_->memory_bytes() : 0);
}

std::string why_no_pipeline(const ks::Device& device, const simsense_rig_desc& rig) {
  if (!device.has_vulkan()) return "the host device has no Vulkan";
  VkPhysicalDeviceVulkan12Features f12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  VkPhysicalDeviceVulkan11Features f11{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES, &f12};
  VkPhysicalDeviceFeatures2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &f11};
  vkGetPhysicalDeviceFeatures2(device.physical(), &all);
  if (!f12.storageBuffer8BitAccess || !f11.storageBuffer16BitAccess) return "storage buffers of 8 or 16 bit are missing";
  if (rig.faults & SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED)
    return "it knows no SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED, which needs doubles";
  return {};
}

}  // namespace simsense
