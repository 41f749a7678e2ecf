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
  /// worker_count: 0 = one thread per core of this process (sched_getaffinity); 1 = only the caller's thread.
  explicit ThreadPool(unsigned worker_count);
  /// Uses the host's threads instead of own ones. worker_count: how many tasks the host gets at once.
  ThreadPool(unsigned worker_count, ks_parallel_for_fn parallel_for, void* user);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;
  [[nodiscard]] unsigned size() const;
  /// Whether the host provides the threads.
  [[nodiscard]] bool is_hosts() const;
  /// Calls fn(index) for each index in [0, count) in ascending order of start, on any thread, and returns when all have ended. Rethrows the
  /// first exception. A call from inside a task runs everything on that task's thread.
  void parallel_for(size_t count, const std::function<void(size_t)>& fn);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace ks
