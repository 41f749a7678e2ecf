// SPDX-License-Identifier: Apache-2.0
// The exception of both engines, and the one place that converts it to a ks_status at the C boundary.
#pragma once

#include <exception>
#include <new>
#include <string>

#include "ks/status.h"

namespace ks {

/// An error on its way to the C boundary: a status, and a text with the thing, the numbers and the remedy.
class Error : public std::exception {
 public:
  Error(ks_status status, std::string text) : status_(status), text_(std::move(text)) {}
  [[nodiscard]] ks_status status() const noexcept { return status_; }
  [[nodiscard]] const char* what() const noexcept override { return text_.c_str(); }

 private:
  ks_status status_;
  std::string text_;
};

/// Throws an Error with a printf-style text.
[[noreturn]] void fail(ks_status status, const char* format, ...) __attribute__((format(printf, 2, 3)));

/// This thread's last error text. Each library has its own, since each links its own copy of this file.
const char* last_error() noexcept;
void set_last_error(const char* text) noexcept;

/// Runs fn, and turns an exception into a status and last_error(). Every extern "C" function is one call of it.
template <class F>
ks_status guard(F&& fn) noexcept {
  try {
    fn();
    return KS_OK;
  } catch (const Error& e) {
    set_last_error(e.what());
    return e.status();
  } catch (const std::bad_alloc&) {
    set_last_error("out of host memory");
    return KS_ERROR_OUT_OF_HOST_MEMORY;
  } catch (const std::exception& e) {
    set_last_error(e.what());
    return KS_ERROR_INTERNAL;
  } catch (...) {
    set_last_error("unknown internal error");
    return KS_ERROR_INTERNAL;
  }
}

}  // namespace ks
