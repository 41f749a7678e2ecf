// SPDX-License-Identifier: Apache-2.0
// Calls that wait, in slices between which Python hears signals (Ctrl-C). Thread rule: the GIL is held.
#pragma once

#include <algorithm>
#include <chrono>
#include <future>
#include <limits>
#include <optional>

#include "bindings/errors.h"

namespace ks_python {

inline constexpr double wait_slice_s = 0.05;

/// None is forever.
template <class Api>
double seconds_to_wait(std::optional<double> timeout_s) {
  if (timeout_s && !(*timeout_s >= 0)) raise_argument<Api>("timeout_s is negative or no number");
  return timeout_s.value_or(std::numeric_limits<double>::infinity());
}

/// wait(slice_ns) is a C call that gives KS_ERROR_TIMEOUT where there is more to wait for. false: there still is after timeout_s.
template <class Api, class Wait>
bool wait_in_slices(double timeout_s, const Wait& wait) {
  for (double left_s = timeout_s;; left_s -= wait_slice_s) {
    const auto slice_ns = static_cast<uint64_t>(1e9 * std::clamp(left_s, 0.0, wait_slice_s));
    const ks_status status = unlocked([&] { return wait(slice_ns); });
    if (status != KS_ERROR_TIMEOUT) {
      check<Api>(status);
      return true;
    }
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    if (left_s <= wait_slice_s) return false;
  }
}

/// The outcome of a call on a thread of its own; the message is that thread's.
struct Outcome {
  ks_status status = KS_OK;
  std::string message;
};

/// Runs call() on another thread. A signal whose Python handler raises makes cancel() end it, and is raised when it has ended. cancel() is
/// repeated until then: one that comes before the thread has begun ends nothing.
template <class Api, class Call, class Cancel>
Outcome run_interruptibly(const Call& call, const Cancel& cancel) {
  std::future<Outcome> running = std::async(std::launch::async, [&call] {
    const ks_status status = call();
    return Outcome{status, status < 0 ? Api::last_error() : ""};
  });
  bool interrupted = false;
  for (;;) {
    const auto now = unlocked([&] { return running.wait_for(std::chrono::duration<double>(wait_slice_s)); });
    if (now == std::future_status::ready) break;
    interrupted = interrupted || PyErr_CheckSignals() != 0;
    if (interrupted) (void)cancel();
  }
  if (interrupted) throw py::error_already_set();
  return running.get();
}

}  // namespace ks_python
