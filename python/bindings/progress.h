// SPDX-License-Identifier: Apache-2.0
// A Python callable as ks_progress_fn. What it raises is kept, the call is cancelled, and rethrow() raises it again.
// Also gives Ctrl-C a chance during long calls. Thread rule: construct, rethrow and destroy with the GIL held.
#pragma once

#include <exception>

#include "bindings/gil.h"

namespace ks_python {

class Progress {
 public:
  /// callback(fraction: float); None = no callback. Returning something true cancels.
  explicit Progress(py::object callback) : callback_(std::move(callback)) {}
  [[nodiscard]] static ks_progress_fn function() { return &Progress::call; }
  void rethrow() const {
    if (raised_) std::rethrow_exception(raised_);
  }

 private:
  static int32_t call(void* user, float fraction) {
    const Locked gil;
    auto& self = *static_cast<Progress*>(user);
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      return !self.callback_.is_none() && py::bool_(self.callback_(fraction));
    } catch (py::error_already_set&) {
      self.raised_ = std::current_exception();
      return 1;
    }
  }

  py::object callback_;
  std::exception_ptr raised_;
};

}  // namespace ks_python
