// SPDX-License-Identifier: Apache-2.0
// Messages: their text on one line, and where a device's go: the host's callback, called by one thread at a time.
#pragma once

#include <mutex>
#include <string>
#include <string_view>

#include "ks/log.h"

namespace ks {

/// Returns the text as one line: control characters become spaces. A text longer than `most` bytes is cut between UTF-8 characters and ends
/// in "...".
inline std::string one_line(std::string_view text, size_t most) {
  const bool cut = text.size() > most;
  if (cut) {
    text = text.substr(0, most - 3);
    while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xc0) == 0x80) text.remove_suffix(1);
    if (!text.empty() && static_cast<unsigned char>(text.back()) >= 0xc0) text.remove_suffix(1);
  }
  std::string out(text);
  for (char& c : out)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  return cut ? out + "..." : out;
}

class LogSink {
 public:
  LogSink(ks_log_fn function, void* user) : function_(function), user_(user) {}
  [[nodiscard]] bool wanted() const { return function_ != nullptr; }
  void write(uint32_t level, const char* text) {
    if (function_ == nullptr) return;
    std::lock_guard lock(mutex_);
    function_(user_, level, text);
  }

 private:
  ks_log_fn function_;
  void* user_;
  std::mutex mutex_;
};

}  // namespace ks
