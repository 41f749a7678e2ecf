// SPDX-License-Identifier: Apache-2.0
// A Python callable as ks_progress_fn. What it raises is kept, the call is cancelled, and check() raises it again.
// Also gives Ctrl-C a chance during long calls. Thread rule: the GIL is held.
#pragma once

#include <exception>

#include "bindings/errors.h"

namespace ks_python {

class Progress {
 public:
  /// callback(fraction: float); None = no callback. Returning something true cancels.
  explicit Progress(py::object callback) : callback_(std::move(callback)) {}
  /// check_unlocked() of a call whose description tells the progress.
  template <class Api, class Desc, class Call>
  void check(Desc& desc, const Call& call) {
    desc.progress = &Progress::tell;
    desc.progress_user = this;
    const ks_status status = unlocked(call);
    if (raised_) std::rethrow_exception(raised_);
    ks_python::check<Api>(status);
  }

 private:
  static int32_t tell(void* user, float fraction) {
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
