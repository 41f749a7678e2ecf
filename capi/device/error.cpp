// SPDX-License-Identifier: Apache-2.0
#include "device/error.h"

#include <cstdarg>
#include <cstdio>

#include "device/log_sink.h"

namespace ks {
namespace {
thread_local char error_text[4096] = "";
}

void fail(ks_status status, const char* format, ...) {
  char text[4096];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  throw Error(status, one_line(text, sizeof text));  // a name from a file or a host may hold anything
}

const char* last_error() noexcept { return error_text; }

void set_last_error(const char* text) noexcept { std::snprintf(error_text, sizeof error_text, "%s", text); }

}  // namespace ks
