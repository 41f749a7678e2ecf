// SPDX-License-Identifier: Apache-2.0
// pthread_cancel inside a call: held back until the call ends or reaches a point where leaving is safe, for drivers hold locks at their own
// cancellation points and would keep them. Threads that are never cancelled notice nothing.
#pragma once

#include <pthread.h>

namespace ks {

/// Delays pthread_cancel of this thread as long as the object lives.
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

/// Marks, as long as it lives, that the host's functions are on this thread's stack: they must not be unwound.
class NoUnwinding {
 public:
  NoUnwinding() { ++frames_of_others; }
  ~NoUnwinding() { --frames_of_others; }
  NoUnwinding(const NoUnwinding&) = delete;
  NoUnwinding& operator=(const NoUnwinding&) = delete;
};

/// Lets a cancelled thread leave between two steps of long work, by unwinding.
inline void cancellation_point() {
  if (frames_of_others > 0) return;
  int held = PTHREAD_CANCEL_DISABLE, ignored = 0;
  pthread_setcancelstate(PTHREAD_CANCEL_ENABLE, &held);
  pthread_testcancel();
  pthread_setcancelstate(held, &ignored);
}

}  // namespace ks
