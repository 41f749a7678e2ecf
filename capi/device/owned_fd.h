// SPDX-License-Identifier: Apache-2.0
// A file descriptor that is ours until Vulkan takes it.
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>

#include "device/error.h"

namespace ks {

class OwnedFd {
 public:
  /// Duplicates the caller's descriptor, which the caller keeps. Throws KS_ERROR_INVALID_ARGUMENT if it is not open.
  explicit OwnedFd(uint64_t callers)
      : fd_(callers <= INT32_MAX ? fcntl(static_cast<int>(callers), F_DUPFD_CLOEXEC, 0) : (errno = EBADF, -1)) {
    if (fd_ < 0)
      fail(KS_ERROR_INVALID_ARGUMENT, "import: fd %llu cannot be duplicated: %s", static_cast<unsigned long long>(callers),
           std::strerror(errno));
  }
  ~OwnedFd() {
    if (fd_ >= 0) close(fd_);
  }
  OwnedFd(const OwnedFd&) = delete;
  OwnedFd& operator=(const OwnedFd&) = delete;
  [[nodiscard]] int get() const { return fd_; }
  void release() { fd_ = -1; }

 private:
  int fd_;
};

}  // namespace ks
