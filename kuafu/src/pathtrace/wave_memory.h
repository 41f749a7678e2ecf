// SPDX-License-Identifier: Apache-2.0
// This is the memory of waves, which grows when needed and is kept, and the slots that waves are rendered in.
// Thread rule: WaveSlots::Lease from any thread, all else externally synchronised.
#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "accel/tracer.h"
#include "device/compute.h"
#include "frame/device_array.h"
#include "shared/wave.h"

namespace kuafu {

struct WaveSize {
  uint32_t capacity = 0;  // paths, a multiple of pixel_block
  uint32_t queue_layout = queue_layout_planes;
  uint32_t channels = 1;
  uint32_t groups = group_count;  // groups of light that are kept apart
  uint32_t shadow_rays_per_vertex = 0;
  uint32_t bounces = 0;  // passes that have a block of counters
  bool environments = false;
  uint32_t features = 0;      // feature_*
  bool visibility = false;    // `aov` asks a shadow ray of each pixel
  uint32_t glass_passes = 0;  // queues of shadow rays that pass glass, surface by surface; 0: shadow rays ask once

  [[nodiscard]] uint32_t shadow_rays_per_path() const { return std::max(shadow_rays_per_vertex, visibility ? 1u : 0u); }
};

/// 32-bit words of a wave's arrays for each path. Arrays of shadow rays hold all shadow rays of a path.
struct WordsPerPath {
  uint32_t rays, environments;  // of two arrays each
  uint32_t state;
  uint32_t shadow_rays, passed_rays;  // the latter of a second array, for those that passed glass
  uint32_t shadow_environments, contributions;

  explicit WordsPerPath(const WaveSize& size);
  [[nodiscard]] uint32_t all() const;
  [[nodiscard]] uint32_t widest_array() const;
};

/// One wave of paths has two closest queues that take turns, shadow queues, a state for each path, and counters.
class WaveBuffers {
 public:
  explicit WaveBuffers(Memory memory) : memory_(std::move(memory)) {}

  void fit(const WaveSize& size);

  [[nodiscard]] RayQueue closest_queue(uint32_t bounce) const;
  /// `passed` says how many surfaces of glass the rays have passed; two queues take turns.
  [[nodiscard]] RayQueue shadow_queue(uint32_t bounce, uint32_t passed = 0) const;
  /// The counter block of shadow_queue(bounce, passed).
  [[nodiscard]] uint32_t shadow_block(uint32_t bounce, uint32_t passed) const {
    return passed == 0 ? bounce : size_.bounces + bounce * size_.glass_passes + passed - 1;
  }
  [[nodiscard]] uint64_t closest_rays(uint32_t bounce) const { return address(rays_[bounce & 1]); }
  [[nodiscard]] uint64_t shadow_rays(uint32_t passed = 0) const { return address(shadow_rays_[passed & 1]); }
  [[nodiscard]] uint64_t closest_environments(uint32_t bounce) const { return address(environments_[bounce & 1]); }
  [[nodiscard]] uint64_t shadow_environments(uint32_t passed = 0) const { return address(shadow_environments_[passed & 1]); }
  [[nodiscard]] uint64_t contributions() const { return address(contributions_); }
  [[nodiscard]] uint64_t state() const { return address(state_); }
  [[nodiscard]] const ks::Buffer& counters() const { return *counters_; }
  [[nodiscard]] uint64_t counter_address() const { return address(counters_); }
  [[nodiscard]] uint64_t counter_bytes() const { return uint64_t(size_.bounces) * (1 + size_.glass_passes) * counter_words * 4; }
  /// The number of a bounce's rays if the host can read it, else the capacity.
  [[nodiscard]] uint32_t ray_count(uint32_t bounce) const;
  /// The number of a bounce's shadow rays if the host can read it, else the capacity.
  [[nodiscard]] uint32_t shadow_ray_count(uint32_t bounce, uint32_t passed) const;
  [[nodiscard]] uint32_t shadow_capacity() const { return size_.capacity * size_.shadow_rays_per_path(); }
  [[nodiscard]] const WaveSize& size() const { return size_; }

 private:
  [[nodiscard]] uint64_t address(const std::shared_ptr<ks::Buffer>& buffer) const { return memory_.address(*buffer); }

  Memory memory_;
  WaveSize size_;
  std::shared_ptr<ks::Buffer> rays_[2], environments_[2], shadow_rays_[2], shadow_environments_[2], contributions_, state_, counters_;
};

/// A wave is rendered in a slot, which has memory for queues and state, and a recorder.
struct WaveSlot {
  WaveBuffers buffers;
  std::unique_ptr<ks::Commands> commands;  // the host's keeps its stage times; a device's slot has none
};

/// A device has one slot; on the host each worker has its own, small enough for its cache.
class WaveSlots {
 public:
  explicit WaveSlots(const Memory& memory);
  void fit(const WaveSize& size);
  [[nodiscard]] const WaveSize& size() const { return slots_.front().buffers.size(); }
  /// The only slot of a device.
  [[nodiscard]] WaveBuffers& only() { return slots_.front().buffers; }

  /// A lease lends one of the host's slots as long as it lives.
  class Lease {
   public:
    explicit Lease(WaveSlots& owner);
    ~Lease();
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    [[nodiscard]] WaveSlot& slot() const { return *slot_; }

   private:
    WaveSlots& owner_;
    WaveSlot* slot_;
  };

  /// Brings the host's stage times, means of all workers, to `commands` and forgets them.
  void collect_times(ks::Commands& commands);

 private:
  std::vector<WaveSlot> slots_;
  std::mutex mutex_;
  std::vector<WaveSlot*> idle_;
};

}  // namespace kuafu
