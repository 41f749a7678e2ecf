// SPDX-License-Identifier: Apache-2.0
// Page-aligned host memory: the buffers of the host device.
#pragma once

#include <cstdint>

namespace ks {

uint64_t page_bytes();
uint64_t physical_memory_bytes();
/// Zero-filled pages; size_bytes is a multiple of page_bytes(). Throws KS_ERROR_OUT_OF_HOST_MEMORY.
void* map_host_pages(uint64_t size_bytes);
void unmap_host_pages(void* pages, uint64_t size_bytes);

}  // namespace ks
