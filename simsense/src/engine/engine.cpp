// SPDX-License-Identifier: Apache-2.0
#include "engine/engine.h"

#include <string>

#include "cpu/calls.h"
#include "device/device.h"
#include "device/error.h"
#include "device/interrupt.h"
#include "stages/settings.h"
#include "vulkan/calls.h"

namespace simsense {
namespace {

simsense_parameters checked(const simsense_parameters& parameters, const simsense_rig_desc& rig) {
  check_parameters(parameters);
  check_region(parameters, rig.left.width, rig.left.height);
  return parameters;
}

}  // namespace

Engine::Engine(std::shared_ptr<ks::Device> device, const simsense_rig_desc& rig, const simsense_parameters& parameters)
    : device_(std::move(device)), rig_(rig), parameters_(checked(parameters, rig)), on_device_(use_vulkan(parameters)) {}

Engine::~Engine() = default;

void Engine::set_parameters(const simsense_parameters& parameters) {
  const simsense_parameters known = checked(parameters, rig_.rig);
  on_device_ = use_vulkan(known);
  parameters_ = known;
}

bool Engine::use_vulkan(const simsense_parameters& parameters) const {
  const uint32_t back_end = rig_.rig.back_end;
  if (back_end == SIMSENSE_BACK_END_CPU || (back_end == SIMSENSE_BACK_END_AUTO && device_->is_cpu())) return false;
  const std::string why_not = why_no_vulkan_calls(*device_, rig_.rig, match_parameters(parameters));
  if (!why_not.empty() && back_end == SIMSENSE_BACK_END_VULKAN)
    ks::fail(KS_ERROR_UNSUPPORTED, "back_end is vulkan, but the Vulkan matcher cannot serve on %s: %s", device_->info().name,
             why_not.c_str());
  return why_not.empty();
}

void Engine::set_signal(const simsense_signal& left, const simsense_signal& right) {
  check_signal(left, "left");
  check_signal(right, "right");
  if (left.extra_bits != right.extra_bits)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "extra_bits is %u in the left signal and %u in the right one: must be the same", left.extra_bits,
             right.extra_bits);
  Imager left_imager(left, &imagers_[0]);
  Imager right_imager(right, &imagers_[1]);
  imagers_[0] = std::move(left_imager);
  imagers_[1] = std::move(right_imager);
}

void Engine::compute(const ComputeRequest& request) {
  const ks::Interrupt interrupt([this, before = wishes_.load()](float) { return wishes_ != before; });
  const StageSettings settings(rig_, parameters_, imagers_, request.noise_seeds);
  check_request(request, rig_, settings);
  stage_times_.clear();
  if (on_device_) {
    (void)wait_for_device(submit_to_device(request, settings), UINT64_MAX);
  } else {
    if (vulkan_) vulkan_->wait_idle();  // what was submitted before the parameters left the device comes first
    request.wait.wait_on_host();
    if (!cpu_) cpu_ = std::make_unique<CpuCalls>(device_, rig_);
    cpu_->compute(request, settings);
    stage_times_ = cpu_->stage_times();
  }
  if (request.progress) request.progress(request.progress_user, 1);
}

ks_sync Engine::submit(const ComputeRequest& request) {
  ks_sync sync = ks_sync_init();
  if (!on_device_ || request.has_host_image()) {
    compute(request);
    return sync;
  }
  const ks::Interrupt interrupt([this, before = wishes_.load()](float) { return wishes_ != before; });
  const StageSettings settings(rig_, parameters_, imagers_, request.noise_seeds);
  check_request(request, rig_, settings);
  stage_times_.clear();
  sync.value = submit_to_device(request, settings);
  if (vulkan_->timeline()) sync.kind = KS_SYNC_TIMELINE;
  return sync;
}

bool Engine::wait(const ks_sync& sync, uint64_t timeout_ns) {
  if (sync.kind == KS_SYNC_HOST) return true;
  if (sync.kind != KS_SYNC_TIMELINE)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "sync: kind is %u, submit gives host (0) or timeline (2)", sync.kind);
  const uint64_t submitted = vulkan_ ? vulkan_->submitted() : 0;
  if (sync.value > submitted)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "sync: value is %llu, only %llu were submitted", static_cast<unsigned long long>(sync.value),
             static_cast<unsigned long long>(submitted));
  return !vulkan_ || wait_for_device(sync.value, timeout_ns);
}

ks_sync Engine::export_timeline() {
  if (!vulkan_ || !vulkan_->timeline())
    ks::fail(KS_ERROR_UNSUPPORTED, "there is no timeline: nothing was submitted to a Vulkan device that has one");
  return vulkan_->timeline()->exported(vulkan_->submitted());
}

uint64_t Engine::submit_to_device(const ComputeRequest& request, const StageSettings& settings) {
  if (!vulkan_) vulkan_ = std::make_unique<VulkanCalls>(device_, rig_);
  return vulkan_->submit(request, settings);
}

bool Engine::wait_for_device(uint64_t submission, uint64_t timeout_ns) {
  if (!vulkan_->wait(submission, timeout_ns)) return false;
  stage_times_ = vulkan_->stage_times();
  return true;
}

}  // namespace simsense
