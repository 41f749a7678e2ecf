// SPDX-License-Identifier: Apache-2.0
// pthread_cancel inside a call: held back until the call ends or reaches a point where leaving is safe, for drivers hold locks at their own
// cancellation points and would keep them. Threads that are never cancelled notice nothing.
#pragma once

#include <pthread.h>

namespace ks {

/// While it lives, pthread_cancel waits.
class CancellationHeld {
 public:
  CancellationHeld() { pthread_setcancelstate(PTHREAD_CANCEL_DISABLE, &before_); }
  ~CancellationHeld() { pthread_setcancelstate(before_, &ignored_); }
  CancellationHeld(const CancellationHeld&) = delete;
  CancellationHeld& operator=(const CancellationHeld&) = delete;

 private:
  int before_ = PTHREAD_CANCEL_ENABLE, ignored_ = 0;
};

inline thread_local int frames_of_others = 0;

/// While it lives, functions of others stand between this thread's work and its call, and nobody may unwind them.
class NoUnwinding {
 public:
  NoUnwinding() { ++frames_of_others; }
  ~NoUnwinding() { --frames_of_others; }
  NoUnwinding(const NoUnwinding&) = delete;
  NoUnwinding& operator=(const NoUnwinding&) = delete;
};

/// Between two steps of long work: a thread that was cancelled leaves from here, by unwinding.
inline void cancellation_point() {
  if (frames_of_others > 0) return;
  int held = PTHREAD_CANCEL_DISABLE, ignored = 0;
  pthread_setcancelstate(PTHREAD_CANCEL_ENABLE, &held);
  pthread_testcancel();
  pthread_setcancelstate(held, &ignored);
}

}  // namespace ks
