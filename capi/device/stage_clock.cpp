// SPDX-License-Identifier: Apache-2.0
#include "device/stage_clock.h"

#include <algorithm>

namespace ks {
namespace {
constexpr uint32_t pool_size = 128;
}

StageClock::~StageClock() {
  for (VkQueryPool pool : pools_) device_->vk().vkDestroyQueryPool(device_->handle(), pool, nullptr);
}

size_t StageClock::stage_index(const char* name) {
  const auto found = std::find_if(times_.begin(), times_.end(), [name](const auto& stage) { return stage.first == name; });
  if (found != times_.end()) return static_cast<size_t>(found - times_.begin());
  times_.emplace_back(name, 0.0);
  return times_.size() - 1;
}

void StageClock::begin_stage(const char* name, VkCommandBuffer commands) {
  const size_t stage = stage_index(name);
  if (stage == current_) return;
  current_ = stage;
  if (commands != VK_NULL_HANDLE) mark(commands);
}

void StageClock::begin_recording(VkCommandBuffer commands) {
  marks_.clear();
  if (running()) mark(commands);
}

void StageClock::end_recording(VkCommandBuffer commands) {
  if (!marks_.empty()) mark(commands);
}

void StageClock::mark(VkCommandBuffer commands) {
  if (!has_timestamps()) return;
  const uint32_t slot = static_cast<uint32_t>(marks_.size() % pool_size);
  const size_t index = marks_.size() / pool_size;
  if (index == pools_.size()) {
    VkQueryPoolCreateInfo info{VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO};
    info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    info.queryCount = pool_size;
    VkQueryPool pool = VK_NULL_HANDLE;
    check(device_->vk().vkCreateQueryPool(device_->handle(), &info, nullptr, &pool), "vkCreateQueryPool");
    pools_.push_back(pool);
  }
  if (slot == 0) device_->vk().vkCmdResetQueryPool(commands, pools_[index], 0, pool_size);
  device_->vk().vkCmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pools_[index], slot);
  marks_.push_back(current_);
}

std::vector<uint64_t> StageClock::read_ticks() const {
  std::vector<uint64_t> ticks(marks_.size());
  for (size_t first = 0; first < ticks.size(); first += pool_size) {
    const uint32_t count = static_cast<uint32_t>(std::min<size_t>(pool_size, ticks.size() - first));
    check(device_->vk().vkGetQueryPoolResults(device_->handle(), pools_[first / pool_size], 0, count, count * sizeof(uint64_t),
                                              &ticks[first], sizeof(uint64_t), VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
          "vkGetQueryPoolResults");
  }
  return ticks;
}

void StageClock::collect(double wall_ms) {
  if (!has_timestamps()) {
    if (running()) times_[current_].second += wall_ms;
    return;
  }
  const uint64_t valid = device_->timestamp_bits() >= 64 ? UINT64_MAX : (uint64_t{1} << device_->timestamp_bits()) - 1;
  const double ms_per_tick = device_->limits().timestampPeriod * 1e-6;  // the period is in nanoseconds
  const std::vector<uint64_t> ticks = read_ticks();
  for (size_t i = 0; i + 1 < ticks.size(); ++i)
    times_[marks_[i]].second += static_cast<double>((ticks[i + 1] - ticks[i]) & valid) * ms_per_tick;
}

void StageClock::add(const char* name, double milliseconds) { times_[stage_index(name)].second += milliseconds; }

void StageClock::reset_times() {
  times_.clear();
  current_ = SIZE_MAX;
}

}  // namespace ks
