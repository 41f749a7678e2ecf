// SPDX-License-Identifier: Apache-2.0
// A timeline semaphore: how far the work of one sender has come. Shared by reference; keeps its device alive. Thread rule: internally
// synchronised.
#pragma once

#include <memory>

#include "device/device.h"

namespace ks {

class Timeline {
 public:
  /// At 0. Throws KS_ERROR_UNSUPPORTED where can_have(device) is false.
  explicit Timeline(std::shared_ptr<Device> device);
  ~Timeline();
  Timeline(const Timeline&) = delete;
  Timeline& operator=(const Timeline&) = delete;

  static bool can_have(const Device& device);
  [[nodiscard]] VkSemaphore handle() const { return semaphore_; }
  [[nodiscard]] uint64_t reached() const;
  /// false: it has not reached the value after so long (UINT64_MAX: however long it takes).
  [[nodiscard]] bool wait(uint64_t value, uint64_t timeout_ns) const;
  /// A new opaque fd, the caller's to close; only with KS_CAP_TIMELINE_FD.
  [[nodiscard]] int export_fd() const;

 private:
  std::shared_ptr<Device> device_;
  VkSemaphore semaphore_ = VK_NULL_HANDLE;
};

}  // namespace ks
