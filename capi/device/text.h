// SPDX-License-Identifier: Apache-2.0
// Text that came from a file or a host, on its way into a message.
#pragma once

#include <string>
#include <string_view>

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

}  // namespace ks
