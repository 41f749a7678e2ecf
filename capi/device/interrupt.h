// SPDX-License-Identifier: Apache-2.0
// The wish to end long work early, asked for by the thread that called us and known to every thread that works for it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <thread>

namespace ks {

/// Lets a call's long work end early. It lives on the calling thread's stack. Work passes interruption_point() about every 50 ms: the
/// caller's thread then calls `ask`, and after an answer of true every thread throws KS_ERROR_CANCELLED.
class Interrupt {
 public:
  using Ask = std::function<bool(float)>;  // takes the share that is done, 0..1; true: end
  explicit Interrupt(Ask ask = {});
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;

  /// The interrupt of the call that this thread works for; nullptr if there is none.
  static Interrupt* current();
  /// Asks at once, with this progress. Only on the caller's thread; throws as point() does.
  void report(float fraction);
  /// Throws KS_ERROR_CANCELLED if the work must end. On the caller's thread it first asks, if the last time was long ago, and lets a thread
  /// leave that pthread_cancel has cancelled.
  void point();
  /// Asks as point() does, but throws nothing of ours: for waits that must go on until other threads have stopped.
  void ask_now_and_then();
  [[nodiscard]] bool requested() const { return requested_.load(std::memory_order_relaxed); }
  void request() { requested_.store(true, std::memory_order_relaxed); }

  /// Makes watch() run this call's work on the caller's thread, without a new one.
  void start_no_thread() { may_start_thread_ = false; }
  /// Runs fn on another thread and asks meanwhile. For work that seldom or never calls interruption_point() on the caller's thread.
  static void watch(const std::function<void()>& fn);

  /// Makes this thread work for another thread's call as long as it lives.
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

/// Long work calls this at places where it may end early; it costs a few nanoseconds.
inline void interruption_point() {
  if (Interrupt* interrupt = Interrupt::current()) interrupt->point();
}
/// Works as interruption_point() for loops with steps of nanoseconds: it looks only in every 65536th step.
inline void interruption_point(size_t step) {
  if (step % 65536 == 0) interruption_point();
}

}  // namespace ks
