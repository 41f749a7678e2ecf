// SPDX-License-Identifier: Apache-2.0
#include "import/budget.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "device/error.h"
#include "io/load.h"

namespace kuafu {
namespace {

using ull = unsigned long long;

/// Bytes that this process has mapped now.
uint64_t address_space_bytes() {
  unsigned long long pages = 0;
  if (std::FILE* file = std::fopen("/proc/self/statm", "r")) {
    if (std::fscanf(file, "%llu", &pages) != 1) pages = 0;
    std::fclose(file);
  }
  return pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

Budget::Budget(uint64_t bytes, uint64_t most_bytes)
    : limit_(std::min(bytes, most_bytes)), most_(most_bytes), own_bytes_(address_space_bytes()) {
  limit_address_space();
}

void Budget::add_file(uint64_t file_bytes) {
  if (limit_ == most_) return;
  const uint64_t room = most_ - limit_;
  limit_ += file_bytes > room / memory_per_file_byte ? room : file_bytes * memory_per_file_byte;
  limit_address_space();
}

void Budget::claim(uint64_t bytes, const std::string& what) {
  if (bytes > limit_ - std::min(claimed_, limit_))
    ks::fail(KS_ERROR_FILE,
             "%.200s would take %llu MiB of memory, with what is read already more than the %llu MiB that files of this size may take: "
             "KUAFU_LOAD_MEMORY_MB allows more",
             what.c_str(), static_cast<ull>(bytes >> 20), static_cast<ull>(limit_ >> 20));
  claimed_ += bytes;
}

void Budget::limit_address_space() const {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  return;  // a sanitizer maps memory of its own, and ends the process or hangs where it gets none: what is claimed counts alone
#endif
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0) return;
  const uint64_t wanted = std::min(limit_, UINT64_MAX / 4) + own_bytes_;
  limit.rlim_cur = limit.rlim_max == RLIM_INFINITY ? wanted : std::min<uint64_t>(wanted, limit.rlim_max);
  (void)setrlimit(RLIMIT_AS, &limit);
}

}  // namespace kuafu
