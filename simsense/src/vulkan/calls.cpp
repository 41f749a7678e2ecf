// SPDX-License-Identifier: Apache-2.0
#include "vulkan/calls.h"

#include <algorithm>

#include "device/error.h"

namespace simsense {
namespace {

constexpr size_t slot_count = 2;

}  // namespace

VulkanCalls::VulkanCalls(std::shared_ptr<ks::Device> device, const PreparedRig& rig)
    : device_(std::move(device)), rig_(rig), stages_(device_, rig), staging_(device_) {
  if (ks::Timeline::can_have(*device_)) timeline_.emplace(device_);
  while (slots_.size() < slot_count) slots_.push_back(std::make_unique<Slot>(device_));
}

VulkanCalls::~VulkanCalls() {
  try {
    wait_idle();
  } catch (const ks::Error&) {
    // The device is lost: nothing runs any more.
  }
}

DeviceFrame VulkanCalls::open(const ComputeRequest& request) {
  DeviceFrame frame;
  staging_.reset();
  open_frame(request, rig_, frame, [this](const ImageArgument& argument, const ImageShape& shape, const char* name) {
    return DeviceImage(staging_, argument, shape, name);
  });
  return frame;
}

void VulkanCalls::record(ks::Commands& commands, const DeviceFrame& frame, const ComputeRequest& request, const StageSettings& settings) {
  stages_.prepare(settings, {frame, rig_.rgb.has_value()});
  commands.reset_stage_times();
  commands.begin_stage("signal");
  commands.barrier();  // after what is under way: both use the same arrays
  stages_.begin(commands, settings);
  const uint32_t pairs = rig_.rig.batch_count, at_once = stages_.pairs_at_once();
  for (uint32_t n = 0; n < pairs; n += at_once) {
    request.tell_progress(n, pairs, 0);
    stages_.record(commands, settings, frame, {n, std::min(at_once, pairs - n)});
  }
}

uint64_t VulkanCalls::submit(const ComputeRequest& request, const StageSettings& settings) {
  // The host's queue may be the one that the signal comes by: a wait in it would stop what it waits for.
  const bool queue_waits = timeline_ && !device_->is_hosts();
  if (!queue_waits) request.wait.wait_on_host();
  DeviceFrame frame = open(request);
  uint64_t outputs = 0;
  for (uint32_t i = 0; i < output_count; ++i) outputs |= uint64_t{frame.wants(i)} << i;
  const bool keeps_arrays = outputs == recorded_outputs_ && settings.wide == recorded_wide_ && stages_.keeps_arrays(settings);
  if (!keeps_arrays) wait_idle();
  recorded_outputs_ = outputs;
  recorded_wide_ = settings.wide;
  std::unique_ptr<Slot>& slot = slots_[submitted_ % slot_count];
  if (slot->number) (void)wait(slot->number, UINT64_MAX);
  for (auto* image : {&frame.inputs[0], &frame.inputs[1], &frame.lasers[0], &frame.lasers[1], &frame.rgb})
    if (*image) (*image)->load();
  slot->frame.emplace(std::move(frame));
  try {
    record(slot->commands, *slot->frame, request, settings);
    if (timeline_) {
      if (queue_waits) slot->wait = request.wait;
      slot->commands.submit(*timeline_, submitted_ + 1, slot->wait);
    } else {
      slot->commands.flush();
    }
  } catch (...) {
    wait_idle();
    slot = std::make_unique<Slot>(device_);
    stages_.discard();
    throw;
  }
  slot->number = ++submitted_;
  return submitted_;
}

void VulkanCalls::finish(Slot& slot) {
  slot.number = 0;
  slot.commands.finish();
  stage_times_ = to_stage_times(slot.commands.stage_times());
  for (auto& output : slot.frame->outputs)
    if (output) output->commit();
  slot.frame.reset();
  slot.wait = {};
}

bool VulkanCalls::wait(uint64_t submission, uint64_t timeout_ns) {
  if (timeline_ && !timeline_->wait(submission, timeout_ns)) return false;
  for (uint64_t number = submission > slot_count ? submission - slot_count + 1 : 1; number <= submission; ++number) {
    Slot& slot = *slots_[(number - 1) % slot_count];
    if (slot.number == number) finish(slot);
  }
  return true;
}

std::string why_no_vulkan_calls(const ks::Device& device, const simsense_rig_desc& rig, const MatchParameters& parameters) {
  if (!device.has_vulkan()) return "the host device has no Vulkan";
  if (!device.features12().storageBuffer8BitAccess || !device.features11().storageBuffer16BitAccess)
    return "storage buffers of 8 or 16 bit are missing";
  if (rig.faults & SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED)
    return "it knows no SIMSENSE_FAULT_REGISTRATION_UNRECTIFIED, which needs doubles";
  return why_not_vulkan(device, rig.left.width, rig.left.height, rig.batch_count, parameters);
}

}  // namespace simsense
