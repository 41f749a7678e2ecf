// SPDX-License-Identifier: Apache-2.0
#include "device/spare_threads.h"

#include <utility>

namespace ks {

SpareThreads::~SpareThreads() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void SpareThreads::run(std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  if (idle_ <= waiting_.size()) threads_.emplace_back([this] { serve(); });
  waiting_.push(std::move(work));
  changed_.notify_one();
}

void SpareThreads::serve() {
  std::unique_lock lock(mutex_);
  for (;;) {
    ++idle_;
    changed_.wait(lock, [&] { return stopping_ || !waiting_.empty(); });
    --idle_;
    if (waiting_.empty()) return;
    const std::function<void()> work = std::move(waiting_.front());
    waiting_.pop();
    lock.unlock();
    work();
    lock.lock();
  }
}

}  // namespace ks
