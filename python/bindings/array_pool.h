// SPDX-License-Identifier: Apache-2.0
// Memory of the arrays that calls make, handed out again once nothing refers to an array any more. For memory of its own the kernel takes a
// page fault every 4 KiB and unmaps it at the end: of an 848x480 depth image that takes longer than the copy into it.
#pragma once

#include <pybind11/numpy.h>

#include <cstdlib>
#include <deque>
#include <mutex>
#include <new>
#include <vector>

#include "bindings/api.h"

namespace ks_python {

class ArrayPool {
 public:
  /// An array that is not initialised, as numpy.empty() makes it.
  static py::array make(const py::dtype& dtype, const std::vector<py::ssize_t>& shape) {
    size_t bytes = static_cast<size_t>(dtype.itemsize());
    for (const py::ssize_t n : shape) bytes *= static_cast<size_t>(n);
    if (bytes < least_bytes) return py::array(dtype, shape);
    const Block block = pool().take((bytes + granule - 1) / granule * granule);
    auto* owned = new Block(block);
    const py::capsule owner(owned, [](void* pointer) {
      const auto* ended = static_cast<Block*>(pointer);
      pool().keep(*ended);
      delete ended;
    });
    return py::array(dtype, shape, block.memory, owner);
  }

 private:
  struct Block {
    void* memory;
    size_t bytes;
  };
  static constexpr size_t least_bytes = size_t{128} << 10;  // below, the allocator maps nothing
  static constexpr size_t granule = size_t{64} << 10;
  static constexpr size_t most_kept_bytes = size_t{64} << 20;

  /// Arrays may end after everything else of the module, so it is never destroyed.
  static ArrayPool& pool() {
    static auto* const one = new ArrayPool;
    return *one;
  }

  Block take(size_t bytes) {
    {
      const std::lock_guard lock(mutex_);
      for (auto block = kept_.rbegin(); block != kept_.rend(); ++block) {
        if (block->bytes != bytes) continue;
        const Block found = *block;
        kept_.erase(std::next(block).base());
        kept_bytes_ -= bytes;
        return found;
      }
    }
    void* memory = std::aligned_alloc(64, bytes);
    if (memory == nullptr) throw std::bad_alloc();
    return {memory, bytes};
  }

  void keep(const Block& block) noexcept {
    const std::lock_guard lock(mutex_);
    try {
      kept_.push_back(block);
    } catch (const std::bad_alloc&) {
      std::free(block.memory);
      return;
    }
    kept_bytes_ += block.bytes;
    for (; kept_bytes_ > most_kept_bytes; kept_.pop_front()) {
      kept_bytes_ -= kept_.front().bytes;
      std::free(kept_.front().memory);
    }
  }

  std::mutex mutex_;
  std::deque<Block> kept_;  // the one that ended last is at the back
  size_t kept_bytes_ = 0;
};

}  // namespace ks_python
