// SPDX-License-Identifier: Apache-2.0
#include "device/handle.h"

#include <pthread.h>

#include <array>
#include <cstdint>
#include <mutex>
#include <new>

namespace ks {
namespace {

struct Block {
  alignas(std::max_align_t) std::array<unsigned char, handle_memory_bytes> handle{};
  Block* next = nullptr;  // of those that wait, the oldest first
};
static_assert(offsetof(Block, handle) == 0);

struct Blocks {
  std::mutex mutex;
  Block *first = nullptr, *last = nullptr;
  size_t waiting = 0;

  Blocks() {
    // A thread of the host may hold the mutex while another one forks.
    pthread_atfork([] { blocks().mutex.lock(); }, [] { blocks().mutex.unlock(); }, [] { blocks().mutex.unlock(); });
  }
  /// Never destroyed: handles may be released while the process ends.
  static Blocks& blocks() {
    static Blocks& all = *new Blocks;
    return all;
  }
};

}  // namespace

void* take_handle_memory() {
  Blocks& blocks = Blocks::blocks();
  const std::lock_guard lock(blocks.mutex);
  if (blocks.waiting <= handles_remembered) return new Block;
  Block* const block = blocks.first;
  blocks.first = block->next;
  --blocks.waiting;
  return block;
}

void give_handle_memory(void* memory) noexcept {
  Blocks& blocks = Blocks::blocks();
  const std::lock_guard lock(blocks.mutex);
  auto* const block = static_cast<Block*>(memory);
  block->next = nullptr;
  (blocks.waiting == 0 ? blocks.first : blocks.last->next) = block;
  blocks.last = block;
  ++blocks.waiting;
}

}  // namespace ks
