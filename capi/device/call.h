// SPDX-License-Identifier: Apache-2.0
// One call of an extern "C" function: exceptions become a status, and the end of a thread passes through.
#pragma once

#include <cxxabi.h>

#include <utility>

#include "device/cancellation.h"
#include "device/error.h"

namespace ks {

/// guard(), but for a thread that ends inside (pthread_cancel, or pthread_exit in a callback): that is no exception of ours, and swallowing
/// it would end the process. It goes on through the host's frames. What is caught then is a reference to nothing, which the
/// undefined-behaviour sanitizer would report.
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
