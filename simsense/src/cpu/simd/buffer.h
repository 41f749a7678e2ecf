// SPDX-License-Identifier: Apache-2.0
// Zero-filled, cache-line aligned work memory, of the host's where it lends some; large ones ask for huge pages, because the matcher walks
// many megabytes per frame.
#pragma once

#include <sys/mman.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>

#include "device/host_memory.h"

namespace simsense::cpu {

constexpr size_t round_up(size_t value, size_t multiple) { return (value + multiple - 1) / multiple * multiple; }

template <class T>
class Buffer {
 public:
  Buffer() = default;
  explicit Buffer(size_t count) {
    constexpr size_t huge_page_bytes = size_t{2} << 20;
    const size_t bytes = count * sizeof(T) + 64;  // one vector of slack behind the last element
    const Free free{ks::HostMemory::current(), bytes};
    void* data = nullptr;
    if (free.lender != nullptr)
      data = free.lender->allocate(bytes, lent_alignment);
    else if (posix_memalign(&data, bytes >= huge_page_bytes ? huge_page_bytes : 64, bytes) != 0)
      throw std::bad_alloc();
    data_ = {static_cast<T*>(data), free};
    // whole huge pages only: the rest of the last one would be memory for nothing
    if (free.lender == nullptr && bytes >= huge_page_bytes) madvise(data, bytes / huge_page_bytes * huge_page_bytes, MADV_HUGEPAGE);
    std::memset(data_.get(), 0, bytes);
  }
  T* data() { return data_.get(); }
  [[nodiscard]] const T* data() const { return data_.get(); }

 private:
  static constexpr uint64_t lent_alignment = 64;
  struct Free {
    const ks::HostMemory* lender = nullptr;  // the system where there is none
    uint64_t bytes = 0;
    void operator()(T* p) const {
      if (lender != nullptr)
        lender->deallocate(p, bytes, lent_alignment);
      else
        std::free(p);
    }
  };
  std::unique_ptr<T, Free> data_;
};

}  // namespace simsense::cpu
