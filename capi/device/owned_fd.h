// SPDX-License-Identifier: Apache-2.0
// A file descriptor that is ours until Vulkan takes it.
#pragma once

#include <cstdint>

namespace ks {

class OwnedFd {
 public:
  /// Duplicates the caller's descriptor, which the caller keeps. Throws KS_ERROR_INVALID_ARGUMENT if it is not open.
  explicit OwnedFd(uint64_t callers);
  ~OwnedFd();
  OwnedFd(const OwnedFd&) = delete;
  OwnedFd& operator=(const OwnedFd&) = delete;
  [[nodiscard]] int get() const { return fd_; }
  void release() { fd_ = -1; }

 private:
  int fd_;
};

}  // namespace ks
