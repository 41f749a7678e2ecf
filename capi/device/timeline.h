// SPDX-License-Identifier: Apache-2.0
// A timeline semaphore: how far the work of one sender has come. Shared by reference; keeps its device alive. Thread rule: internally
// synchronised.
#pragma once

#include <memory>

#include "device/device.h"
#include "ks/sync.h"

namespace ks {

class Timeline {
 public:
  /// At 0. Throws KS_ERROR_UNSUPPORTED where can_have(device) is false.
  explicit Timeline(std::shared_ptr<Device> device);
  /// Another's: by a duplicate of its KS_SYNC_TIMELINE_FD, or by its KS_SYNC_SEMAPHORE, which stays its owner's.
  Timeline(std::shared_ptr<Device> device, const ks_sync& sync);
  ~Timeline();
  Timeline(const Timeline&) = delete;
  Timeline& operator=(const Timeline&) = delete;

  static bool can_have(const Device& device);
  [[nodiscard]] VkSemaphore handle() const { return semaphore_; }
  [[nodiscard]] uint64_t reached() const;
  /// false: it has not reached the value after so long (UINT64_MAX: however long it takes).
  [[nodiscard]] bool wait(uint64_t value, uint64_t timeout_ns) const;
  /// From the host; `value` is above what was reached.
  void signal(uint64_t value) const;
  /// With this value: on the host's own device the semaphore, else a new opaque fd, the caller's to close (KS_CAP_TIMELINE_FD).
  [[nodiscard]] ks_sync exported(uint64_t value) const;

 private:
  [[nodiscard]] int export_fd() const;
  void import_fd(uint64_t fd);
  void make(bool exportable);
  std::shared_ptr<Device> device_;
  VkSemaphore semaphore_ = VK_NULL_HANDLE;
  bool owned_ = true;
};

/// When a timeline has reached a value; at once where there is no timeline.
struct TimelinePoint {
  std::shared_ptr<const Timeline> timeline;
  uint64_t value = 0;

  /// Throws KS_ERROR_CANCELLED where the call that this thread works for is to end.
  void wait_on_host() const;
};

/// What a caller wants waited for; sync may be NULL. Throws for a kind that is not another's timeline, and what Timeline throws.
TimelinePoint point_of(const std::shared_ptr<Device>& device, const ks_sync* sync);

}  // namespace ks
