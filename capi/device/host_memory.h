// SPDX-License-Identifier: Apache-2.0
// Large blocks of host memory: pages of the system, or memory that the host lends (ks_host_services).
#pragma once

#include <cstdint>

#include "ks/device.h"

namespace ks {

uint64_t page_bytes();
uint64_t physical_memory_bytes();
/// Maps zero-filled pages; size_bytes is a multiple of page_bytes(). Throws KS_ERROR_OUT_OF_HOST_MEMORY.
void* map_host_pages(uint64_t size_bytes);
void unmap_host_pages(void* pages, uint64_t size_bytes);

/// The host's memory functions. Thread rule: internally synchronised, as they are.
class HostMemory {
 public:
  HostMemory(ks_allocate_fn allocate, ks_deallocate_fn deallocate, void* user)
      : allocate_(allocate), deallocate_(deallocate), user_(user) {}

  /// Allocates memory with undefined content. Throws KS_ERROR_OUT_OF_HOST_MEMORY, or KS_ERROR_INVALID_ARGUMENT if the host's address is not
  /// aligned.
  [[nodiscard]] void* allocate(uint64_t size_bytes, uint64_t alignment_bytes) const;
  void deallocate(void* memory, uint64_t size_bytes, uint64_t alignment_bytes) const {
    deallocate_(user_, memory, size_bytes, alignment_bytes);
  }

  /// The memory functions of the call that this thread works for; nullptr means the system's.
  static HostMemory* current();

  /// Makes some memory functions this thread's current ones as long as it lives. They must outlive what is allocated.
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
