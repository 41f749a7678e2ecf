// SPDX-License-Identifier: Apache-2.0
// Python's lock, given up during calls of the library and taken for callbacks. A thread that wants it while the interpreter ends is stopped
// for good, for it can neither run Python nor leave: CPython up to 3.13 would end it by pthread_exit, which C++ frames cannot always
// survive (CPython 3.14 stops such threads too). The process then ends as if they were not there.
#pragma once

#include <cxxabi.h>
#include <unistd.h>

#include "bindings/api.h"

namespace ks_python {

[[noreturn]] inline void stop_this_thread() {
  for (;;) pause();
}

/// From the beginning of the interpreter's end, for good.
inline bool interpreter_ends() {
#if PY_VERSION_HEX >= 0x030d0000
  return Py_IsFinalizing() != 0 || Py_IsInitialized() == 0;
#else
  return _Py_IsFinalizing() != 0 || Py_IsInitialized() == 0;
#endif
}

/// Whether this thread can no longer run Python: the main thread ends the interpreter and runs it to the last.
inline bool shut_out() { return interpreter_ends() && gettid() != getpid(); }

/// While it lives, other threads run Python.
class Unlocked {
 public:
  Unlocked() : state_(PyEval_SaveThread()) {}
  ~Unlocked() {
    if (shut_out()) stop_this_thread();
    try {
      PyEval_RestoreThread(state_);
    } catch (abi::__forced_unwind&) {
      stop_this_thread();
    }
  }
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;

 private:
  PyThreadState* state_;
};

/// What call() returns; other Python threads run meanwhile.
template <class Call>
auto unlocked(const Call& call) {
  const Unlocked nogil;
  return call();
}

/// While it lives, this thread, of Python's or of the library's, runs Python.
class Locked {
 public:
  Locked() {
    if (shut_out()) stop_this_thread();
    try {
      state_ = PyGILState_Ensure();
    } catch (abi::__forced_unwind&) {
      stop_this_thread();
    }
  }
  ~Locked() { PyGILState_Release(state_); }
  Locked(const Locked&) = delete;
  Locked& operator=(const Locked&) = delete;

 private:
  PyGILState_STATE state_{};
};

}  // namespace ks_python
