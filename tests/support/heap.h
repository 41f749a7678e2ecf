// SPDX-License-Identifier: Apache-2.0
// What a process holds now: bytes of its heap and open files. Unlike the resident memory, neither depends on what else the machine does.
#pragma once

#include <malloc.h>

#include <cstddef>
#include <filesystem>
#include <iterator>
#ifdef __SANITIZE_ADDRESS__
extern "C" size_t __sanitizer_get_current_allocated_bytes();  // GCC has it, but ships no header for it
#endif

namespace ks::test {

/// Allocated and not freed, of all threads. A few kilobytes come and go with the allocator's caches.
inline size_t heap_bytes() {
#ifdef __SANITIZE_ADDRESS__
  return __sanitizer_get_current_allocated_bytes();
#else
  const struct mallinfo2 info = mallinfo2();
  return info.uordblks + info.hblkhd;
#endif
}

inline size_t open_files() {
  return static_cast<size_t>(std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator()));
}

}  // namespace ks::test
