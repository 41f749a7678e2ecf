// SPDX-License-Identifier: Apache-2.0
// Worker threads of a device. The calling thread works too; results must not depend on how many there are.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

#include "ks/device.h"

namespace ks {

class ThreadPool {
 public:
  /// worker_count: 0 = one per core this process may run on (sched_getaffinity); 1 = everything on the caller.
  explicit ThreadPool(unsigned worker_count);
  /// On the host's threads instead of its own; `worker_count` is how many tasks the host gets at once.
  ThreadPool(unsigned worker_count, ks_parallel_for_fn parallel_for, void* user);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;
  [[nodiscard]] unsigned size() const;
  /// Whether the threads are the host's.
  [[nodiscard]] bool is_hosts() const;
  /// Calls fn(index) for each index in [0, count), started in ascending order, on any thread; returns when all are done. Rethrows the first
  /// exception. Called by a task, it runs everything in that task's thread.
  void parallel_for(size_t count, const std::function<void(size_t)>& fn);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace ks
