// SPDX-License-Identifier: Apache-2.0
// Threads that wait for new work after their last one has ended. Some libraries keep memory for every thread that ever ran, as Embree does
// for each that built a tree; with reused threads it does not grow. Thread rule: internally synchronised.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <queue>
#include <thread>
#include <vector>

namespace ks {

class SpareThreads {
 public:
  SpareThreads() = default;
  /// Waits until all work has ended.
  ~SpareThreads();
  SpareThreads(const SpareThreads&) = delete;
  SpareThreads& operator=(const SpareThreads&) = delete;

  /// Starts the work on an idle thread or a new one. An exception that it throws ends the process.
  void run(std::function<void()> work);

 private:
  void serve();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::queue<std::function<void()>> waiting_;
  size_t idle_ = 0;
  bool stopping_ = false;
  std::vector<std::thread> threads_;
};

}  // namespace ks
