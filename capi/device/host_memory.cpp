// SPDX-License-Identifier: Apache-2.0
#include "device/host_memory.h"

#include <sys/mman.h>
#include <unistd.h>

#include <utility>

#include "device/error.h"

namespace ks {
namespace {

thread_local HostMemory* current_memory = nullptr;

}  // namespace

uint64_t page_bytes() { return static_cast<uint64_t>(sysconf(_SC_PAGESIZE)); }

uint64_t physical_memory_bytes() { return static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * page_bytes(); }

void* map_host_pages(uint64_t size_bytes) {
  // Linux overcommits: a size beyond all memory would map well and be killed when used.
  void* pages = size_bytes > physical_memory_bytes()
                    ? MAP_FAILED
                    : mmap(nullptr, size_bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (pages == MAP_FAILED)
    fail(KS_ERROR_OUT_OF_HOST_MEMORY, "a buffer of %llu bytes does not fit the host's %llu bytes of memory",
         static_cast<unsigned long long>(size_bytes), static_cast<unsigned long long>(physical_memory_bytes()));
  return pages;
}

void unmap_host_pages(void* pages, uint64_t size_bytes) { munmap(pages, size_bytes); }

void* HostMemory::allocate(uint64_t size_bytes, uint64_t alignment_bytes) const {
  using ull = unsigned long long;
  void* memory = allocate_(user_, size_bytes, alignment_bytes);
  if (memory == nullptr) fail(KS_ERROR_OUT_OF_HOST_MEMORY, "the host's allocate gave nothing for %llu bytes", static_cast<ull>(size_bytes));
  if (reinterpret_cast<uintptr_t>(memory) % alignment_bytes != 0) {
    deallocate(memory, size_bytes, alignment_bytes);
    fail(KS_ERROR_INVALID_ARGUMENT, "the host's allocate gave %p, which is no multiple of the %llu bytes that were asked for", memory,
         static_cast<ull>(alignment_bytes));
  }
  return memory;
}

HostMemory* HostMemory::current() { return current_memory; }

HostMemory::Use::Use(HostMemory* memory) : before_(std::exchange(current_memory, memory)) {}

HostMemory::Use::~Use() { current_memory = before_; }

}  // namespace ks
