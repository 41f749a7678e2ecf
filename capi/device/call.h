// SPDX-License-Identifier: Apache-2.0
// One call of an extern "C" function: exceptions become a status, and the end of a thread passes through.
#pragma once

#include <cxxabi.h>

#include <utility>

#include "device/cancellation.h"
#include "device/error.h"

namespace ks {

/// Works as guard(), but lets the unwinding of a thread pass that ends inside (pthread_cancel, or pthread_exit in a callback). To catch it
/// would end the process. The sanitizer is off here because that exception is caught as a reference to nothing.
template <class F>
__attribute__((no_sanitize("undefined"))) ks_status call(F&& fn) {
  const CancellationHeld held;
  try {
    std::forward<F>(fn)();
    return KS_OK;
  } catch (abi::__forced_unwind&) {
    throw;
  } catch (...) {
    return guard([] { throw; });
  }
}

}  // namespace ks
