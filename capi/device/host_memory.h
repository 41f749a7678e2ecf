// SPDX-License-Identifier: Apache-2.0
// Large blocks of host memory: pages of the system, or memory that the host lends (ks_host_services).
#pragma once

#include <cstdint>

#include "ks/device.h"

namespace ks {

uint64_t page_bytes();
uint64_t physical_memory_bytes();
/// Zero-filled pages; size_bytes is a multiple of page_bytes(). Throws KS_ERROR_OUT_OF_HOST_MEMORY.
void* map_host_pages(uint64_t size_bytes);
void unmap_host_pages(void* pages, uint64_t size_bytes);

/// The host's functions. Thread rule: internally synchronised, as the host's functions are.
class HostMemory {
 public:
  HostMemory(ks_allocate_fn allocate, ks_deallocate_fn deallocate, void* user)
      : allocate_(allocate), deallocate_(deallocate), user_(user) {}

  /// Memory with any content. Throws KS_ERROR_OUT_OF_HOST_MEMORY, and KS_ERROR_INVALID_ARGUMENT for an address that is not aligned.
  [[nodiscard]] void* allocate(uint64_t size_bytes, uint64_t alignment_bytes) const;
  void deallocate(void* memory, uint64_t size_bytes, uint64_t alignment_bytes) const {
    deallocate_(user_, memory, size_bytes, alignment_bytes);
  }

  /// What the call that this thread works for takes its memory from; nullptr: the system.
  static HostMemory* current();

  /// While it lives, this thread's current one. It outlives what is allocated.
  class Use {
   public:
    explicit Use(HostMemory* memory);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    HostMemory* before_;
  };

 private:
  ks_allocate_fn allocate_;
  ks_deallocate_fn deallocate_;
  void* user_;
};

}  // namespace ks
