// SPDX-License-Identifier: Apache-2.0
#include "pathtrace/wave_memory.h"

#include <algorithm>

#include "device/error.h"
#include "device/thread_pool.h"

namespace kuafu {

WordsPerPath::WordsPerPath(const WaveSize& size) {
  const uint32_t shadows = size.shadow_rays_per_path();
  const bool glass = size.glass_passes > 0;
  rays = queue_words_per_ray(closest_words, size.queue_layout);
  environments = size.environments ? 1 : 0;
  state = state_shadow(size.channels, size.groups) + size.shadow_rays_per_vertex;
  shadow_rays = shadows * queue_words_per_ray(glass ? closest_words : occlusion_words, size.queue_layout);
  passed_rays = glass ? shadow_rays : 0;
  shadow_environments = shadows * environments;
  contributions = shadows * (size.channels + (glass ? 1 : 0));
}

uint32_t WordsPerPath::all() const {
  return 2 * (rays + environments) + state + shadow_rays + passed_rays + (passed_rays ? 2 : 1) * shadow_environments + contributions;
}

uint32_t WordsPerPath::widest_array() const { return std::max({rays, state, shadow_rays, contributions}); }

void WaveBuffers::fit(const WaveSize& size) {
  size_ = size;
  const WordsPerPath words(size);
  const uint64_t capacity = size.capacity;
  for (auto& rays : rays_) grow(memory_, rays, capacity * words.rays);
  for (auto& environments : environments_) grow(memory_, environments, std::max<uint64_t>(capacity * words.environments, 1));
  grow(memory_, shadow_rays_[0], capacity * words.shadow_rays);
  grow(memory_, shadow_rays_[1], capacity * words.passed_rays);
  grow(memory_, shadow_environments_[0], capacity * words.shadow_environments);
  grow(memory_, shadow_environments_[1], words.passed_rays ? capacity * words.shadow_environments : 0);
  grow(memory_, contributions_, capacity * words.contributions);
  grow(memory_, state_, capacity * words.state);
  grow(memory_, counters_, counter_bytes() / 4);
}

RayQueue WaveBuffers::closest_queue(uint32_t bounce) const {
  RayQueue queue;
  queue.words = rays_[bounce & 1].get();
  queue.environments = size_.environments ? environments_[bounce & 1].get() : nullptr;
  queue.counters = counters_.get();
  queue.count_offset = (uint64_t(bounce) * counter_words + counter_ray_count) * 4;
  queue.arguments_offset = (uint64_t(bounce) * counter_words + counter_trace_arguments) * 4;
  queue.capacity = size_.capacity;
  queue.coherent = bounce == 0;
  return queue;
}

RayQueue WaveBuffers::shadow_queue(uint32_t bounce, uint32_t passed) const {
  const uint64_t block = uint64_t(shadow_block(bounce, passed)) * counter_words;
  RayQueue queue;
  queue.words = shadow_rays_[passed & 1].get();
  queue.environments = size_.environments ? shadow_environments_[passed & 1].get() : nullptr;
  queue.counters = counters_.get();
  queue.count_offset = (block + counter_shadow_count) * 4;
  queue.arguments_offset = (block + counter_shadow_arguments) * 4;
  queue.capacity = shadow_capacity();
  return queue;
}

uint32_t WaveBuffers::ray_count(uint32_t bounce) const {
  // While the host records, it knows nothing of a GPU's counters, mapped or not.
  const auto* words = memory_.device->is_cpu() ? static_cast<const uint32_t*>(counters_->mapped()) : nullptr;
  return words ? words[bounce * counter_words + counter_ray_count] : size_.capacity;
}

uint32_t WaveBuffers::shadow_ray_count(uint32_t bounce, uint32_t passed) const {
  const auto* words = static_cast<const uint32_t*>(counters_->mapped());
  return words ? words[shadow_block(bounce, passed) * counter_words + counter_shadow_count] : shadow_capacity();
}

WaveSlots::WaveSlots(const Memory& memory) {
  const size_t count = memory.on_host ? memory.device->workers().size() : 1;
  for (size_t i = 0; i < count; ++i)
    slots_.push_back({WaveBuffers(memory), memory.on_host ? std::make_unique<ks::Commands>(memory.device) : nullptr});
  for (WaveSlot& slot : slots_) idle_.push_back(&slot);
}

void WaveSlots::fit(const WaveSize& size) {
  for (WaveSlot& slot : slots_) slot.buffers.fit(size);
}

WaveSlots::Lease::Lease(WaveSlots& owner) : owner_(owner) {
  const std::lock_guard lock(owner_.mutex_);
  if (owner_.idle_.empty()) ks::fail(KS_ERROR_INTERNAL, "more waves at once than the device has workers (%zu)", owner_.slots_.size());
  slot_ = owner_.idle_.back();
  owner_.idle_.pop_back();
}

WaveSlots::Lease::~Lease() {
  const std::lock_guard lock(owner_.mutex_);
  owner_.idle_.push_back(slot_);
}

void WaveSlots::collect_times(ks::Commands& commands) {
  for (WaveSlot& slot : slots_) {
    if (!slot.commands) continue;
    for (const auto& [name, milliseconds] : slot.commands->stage_times())
      commands.add_host_time(name.c_str(), milliseconds / double(slots_.size()));
    slot.commands->reset_stage_times();
  }
}

}  // namespace kuafu
