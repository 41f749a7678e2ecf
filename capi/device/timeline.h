// SPDX-License-Identifier: Apache-2.0
// A timeline semaphore: a number that grows as one sender's work proceeds. Shared by reference; keeps its device alive. Thread rule:
// internally synchronised.
#pragma once

#include <memory>

#include "device/device.h"
#include "ks/sync.h"

namespace ks {

class Timeline {
 public:
  /// Makes a timeline semaphore at value 0. Throws KS_ERROR_UNSUPPORTED unless can_have(device).
  explicit Timeline(std::shared_ptr<Device> device);
  /// Imports another library's timeline: a duplicate of its KS_SYNC_TIMELINE_FD, or its KS_SYNC_SEMAPHORE, which its owner keeps.
  Timeline(std::shared_ptr<Device> device, const ks_sync& sync);
  ~Timeline();
  Timeline(const Timeline&) = delete;
  Timeline& operator=(const Timeline&) = delete;

  static bool can_have(const Device& device);
  [[nodiscard]] VkSemaphore handle() const { return semaphore_; }
  [[nodiscard]] uint64_t reached() const;
  /// Waits for a value. Returns false if the timeout ended first (UINT64_MAX: no timeout).
  [[nodiscard]] bool wait(uint64_t value, uint64_t timeout_ns) const;
  /// Sets the value from the host; it must be larger than the present one.
  void signal(uint64_t value) const;
  /// Exports the timeline with this value. On a device that the host made it is the semaphore, else a new opaque fd that the caller closes
  /// (KS_CAP_TIMELINE_FD).
  [[nodiscard]] ks_sync exported(uint64_t value) const;

 private:
  [[nodiscard]] int export_fd() const;
  void import_fd(uint64_t fd);
  void make(bool exportable);
  std::shared_ptr<Device> device_;
  VkSemaphore semaphore_ = VK_NULL_HANDLE;
  bool owned_ = true;
};

/// A point in time: a timeline reaches a value. Without a timeline it has passed already.
struct TimelinePoint {
  std::shared_ptr<const Timeline> timeline;
  uint64_t value = 0;

  /// Waits on the host. Throws KS_ERROR_CANCELLED if the call that this thread works for must end.
  void wait_on_host() const;
};

/// Converts a caller's sync, which may be NULL, to a point in time. Throws for a kind other than an imported timeline, and Timeline's
/// errors.
TimelinePoint point_of(const std::shared_ptr<Device>& device, const ks_sync* sync);

}  // namespace ks
