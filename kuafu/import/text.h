// SPDX-License-Identifier: Apache-2.0
// Lines, words and numbers of text files. Thread rule: pure functions.
#pragma once

#include <charconv>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>

#include "device/error.h"

namespace kuafu {

inline bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

/// Returns the text without blanks at its ends.
inline std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  return text;
}

/// Returns the text with ASCII letters in lower case.
inline std::string lower_case(std::string_view text) {
  std::string out(text);
  for (char& c : out)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return out;
}

/// Returns the text without the byte order mark that Windows programs write first. Throws if the text is not UTF-8.
inline std::string_view without_mark(std::string_view text) {
  if (text.starts_with("\xff\xfe") || text.starts_with("\xfe\xff")) ks::fail(KS_ERROR_FILE, "line 1: the text is UTF-16: save it as UTF-8");
  return text.substr(text.starts_with("\xef\xbb\xbf") ? 3 : 0);
}

/// Removes and returns the next word of a line; empty at its end.
inline std::string_view take_word(std::string_view& line) {
  size_t at = 0;
  while (at < line.size() && is_blank(line[at])) ++at;
  size_t end = at;
  while (end < line.size() && !is_blank(line[end])) ++end;
  const std::string_view word = line.substr(at, end - at);
  line.remove_prefix(end);
  return word;
}

/// Removes and returns the next line of a text, without its end: "\n", "\r\n" or old Macs' "\r".
inline std::string_view take_line(std::string_view& text) {
  const size_t end = std::min(text.find_first_of("\r\n"), text.size());
  const std::string_view line = text.substr(0, end);
  const bool two = text.substr(end, 2) == "\r\n";
  text.remove_prefix(std::min(end + (two ? 2 : 1), text.size()));
  return line;
}

/// Parses a decimal number in C's notation, also with a "+". Throws if the word is none or exceeds a float.
inline double parse_real(std::string_view word, uint64_t line) {
  const std::string_view digits = word.substr(word.starts_with('+') ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.starts_with('+') || digits.empty() || error == std::errc::invalid_argument || end != digits.data() + digits.size())
    ks::fail(KS_ERROR_FILE, "line %zu: '%.*s' is no number", static_cast<size_t>(line), static_cast<int>(std::min<size_t>(word.size(), 40)),
             word.data());
  if (error == std::errc::result_out_of_range)  // of a double: from_chars leaves the value as it was
    value = digits.find("e-") != std::string_view::npos || digits.find("E-") != std::string_view::npos ? 0.0 : HUGE_VAL;
  if (!std::isfinite(value) || std::fabs(value) > double{std::numeric_limits<float>::max()})
    ks::fail(KS_ERROR_FILE, "line %zu: %.*s is beyond what a 32-bit number holds", static_cast<size_t>(line),
             static_cast<int>(std::min<size_t>(word.size(), 40)), word.data());
  return value;
}

}  // namespace kuafu
