// SPDX-License-Identifier: Apache-2.0
#include "device/owned_fd.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "device/error.h"

namespace ks {

OwnedFd::OwnedFd(uint64_t callers)
    : fd_(callers <= INT32_MAX ? fcntl(static_cast<int>(callers), F_DUPFD_CLOEXEC, 0) : (errno = EBADF, -1)) {
  if (fd_ < 0)
    fail(KS_ERROR_INVALID_ARGUMENT, "import: fd %llu cannot be duplicated: %s", static_cast<unsigned long long>(callers),
         std::strerror(errno));
}

OwnedFd::~OwnedFd() {
  if (fd_ >= 0) close(fd_);
}

}  // namespace ks
