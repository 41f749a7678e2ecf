// SPDX-License-Identifier: Apache-2.0
// The progress of a stage that several threads share. Each thread asks between two pieces of work whether to go on; the thread that called
// the matcher then tells its caller.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

namespace simsense::cpu {

class Progress {
 public:
  /// The stage runs from share `begin` to share `end` of the whole, in `count` pieces.
  Progress(const std::function<void(float)>& tell, float begin, float end, size_t count)
      : tell_(tell), begin_(begin), scale_((end - begin) / static_cast<float>(count)) {}

  /// Call after each `pieces` of work, 0 inside a piece. Returns false if the caller's function threw: the work must then end.
  bool go_on(size_t pieces) {
    const size_t done = done_.fetch_add(pieces, std::memory_order_relaxed) + pieces;
    if (!tell_ || std::this_thread::get_id() != caller_) return !stopped_.load(std::memory_order_relaxed);
    try {
      tell_(begin_ + scale_ * static_cast<float>(done));
    } catch (...) {
      stopped_.store(true, std::memory_order_relaxed);
      throw;
    }
    return true;
  }

 private:
  const std::function<void(float)>& tell_;
  float begin_, scale_;
  std::thread::id caller_ = std::this_thread::get_id();
  std::atomic<size_t> done_{0};
  std::atomic<bool> stopped_{false};
};

}  // namespace simsense::cpu
