// SPDX-License-Identifier: Apache-2.0
#include "device/error.h"

#include <cstdarg>
#include <cstdio>

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
  for (char& c : text) {
    if (c == '\0') break;
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';  // a name from a file or a host may hold anything
  }
  throw Error(status, text);
}

const char* last_error() noexcept { return error_text; }

void set_last_error(const char* text) noexcept { std::snprintf(error_text, sizeof error_text, "%s", text); }

}  // namespace ks
