// SPDX-License-Identifier: Apache-2.0
// The wish to end long work early, asked for by the thread that called us and known to every thread that works for it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <thread>

namespace ks {

/// Lives on the calling thread's stack while its call works. Long work passes interruption_point() at least every 50 ms or so, wherever it
/// runs: there the caller's thread asks `ask` now and then, and every thread leaves by KS_ERROR_CANCELLED once the answer was true.
class Interrupt {
 public:
  using Ask = std::function<bool(float)>;  // takes the share that is done, 0..1; true: end
  explicit Interrupt(Ask ask = {});
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  /// Of the call that this thread works for; nullptr where there is none.
  static Interrupt* current();
  /// Asks now. On the caller's thread; throws like point().
  void report(float fraction);
  /// Throws KS_ERROR_CANCELLED if the work is to end. On the caller's thread it asks first, if the last time was long ago, and lets a
  /// thread that was cancelled by pthread_cancel leave.
  void point();
  /// As point(), but throws nothing of ours: for waits that must go on until others have stopped.
  void ask_now_and_then();
  [[nodiscard]] bool requested() const { return requested_.load(std::memory_order_relaxed); }
  void request() { requested_.store(true, std::memory_order_relaxed); }

  /// No thread is started for this call: watch() runs in the caller's.
  void start_no_thread() { may_start_thread_ = false; }
  /// Runs fn on another thread while this one asks: for work that calls interruption_point too seldom on the caller's thread, or on none.
  static void watch(const std::function<void()>& fn);

  /// While it lives, this thread works for the call of another.
  class Adopted {
   public:
    explicit Adopted(Interrupt* of);
    ~Adopted();
    Adopted(const Adopted&) = delete;
    Adopted& operator=(const Adopted&) = delete;

   private:
    Interrupt* before_;
  };

 private:
  void ask();
  [[noreturn]] void leave() const;

  Ask ask_;
  std::thread::id caller_ = std::this_thread::get_id();
  Interrupt* before_;
  std::atomic<bool> requested_{false};
  bool may_start_thread_ = true;
  std::atomic<float> fraction_{0.0f};  // written by the caller's thread, told by any
  std::chrono::steady_clock::time_point asked_ = std::chrono::steady_clock::now();
};

/// Where long work may end early; costs a few nanoseconds.
inline void interruption_point() {
  if (Interrupt* interrupt = Interrupt::current()) interrupt->point();
}
/// For each step of a loop whose steps take nanoseconds; only every 65536th looks.
inline void interruption_point(size_t step) {
  if (step % 65536 == 0) interruption_point();
}

}  // namespace ks
