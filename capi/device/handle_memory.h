// SPDX-License-Identifier: Apache-2.0
// Memory of handles: fixed blocks that are never given back to the allocator and are used again late, so that a caller who uses a handle
// after its last release meets its erased tag, not foreign memory. Thread rule: any thread, also after fork.
#pragma once

#include <cstddef>

namespace ks {

inline constexpr size_t handle_memory_bytes = 64;
/// Blocks that wait at least: a handle is recognised as released until so many others were released.
inline constexpr size_t handles_remembered = 1024;

/// Allocates a block of handle_memory_bytes. Throws std::bad_alloc.
void* take_handle_memory();
void give_handle_memory(void* block) noexcept;

}  // namespace ks
