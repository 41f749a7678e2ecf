// SPDX-License-Identifier: Apache-2.0
// A string of bytes as a source of choices, for programs that make calls of it. When it ends, every choice is 0.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>

#include "ks/header.h"

class Bytes {
 public:
  Bytes(const uint8_t* data, size_t size) : data_(data), left_(size) {}
  [[nodiscard]] bool empty() const { return left_ == 0; }

  uint8_t byte() {
    if (left_ == 0) return 0;
    --left_;
    return *data_++;
  }
  uint32_t below(uint32_t count) { return byte() % count; }
  uint32_t word() {
    uint32_t value = 0;
    for (int i = 0; i < 4; ++i) value = value << 8 | byte();
    return value;
  }
  /// Small numbers, and absurd ones.
  uint64_t size() {
    static constexpr uint64_t odd[] = {0,         1,          uint64_t{1} << 31, UINT32_MAX,        uint64_t{1} << 32, uint64_t{1} << 40,
                                       INT64_MAX, UINT64_MAX, UINT64_MAX - 3,    UINT64_MAX / 4 + 1};
    const uint8_t first = byte();
    return first < 240 ? first : odd[first % 10];
  }
  /// Numbers near 1, and what is no number.
  double number() {
    static constexpr double odd[] = {std::numeric_limits<double>::quiet_NaN(),
                                     std::numeric_limits<double>::infinity(),
                                     -std::numeric_limits<double>::infinity(),
                                     1e300,
                                     -1e300,
                                     1e38,
                                     5e-324,
                                     1e-30,
                                     -0.0,
                                     2147483648.0};
    const uint8_t first = byte();
    return first < 200 ? (first - 60) / 16.0 : odd[first % 10];
  }
  /// Overwrites some of a struct's fields behind its header; pointers in it are put right by the caller afterwards.
  template <class T>
  void disturb(T& value) {
    for (uint32_t n = below(4); n > 0; --n) {
      const size_t at = sizeof(ks_header) + word() % (sizeof(T) - sizeof(ks_header));
      switch (below(4)) {
        case 0:
          put<uint32_t>(value, at, static_cast<uint32_t>(size()));
          break;
        case 1:
          put<float>(value, at, static_cast<float>(number()));
          break;
        case 2:
          put<double>(value, at, number());
          break;
        default:
          put<uint64_t>(value, at, size());
      }
    }
    if (below(32) == 0) put<uint32_t>(value, offsetof(ks_header, type), static_cast<uint32_t>(size()));
    if (below(32) == 0) {  // its size: shorter than it is, or absurd; one that is longer would be the caller's lie
      const auto bytes = static_cast<uint32_t>(size());
      put<uint32_t>(value, offsetof(ks_header, size_bytes), bytes < 1u << 31 ? bytes % (sizeof value + 1) : bytes);
    }
  }

 private:
  template <class Field, class T>
  static void put(T& value, size_t at, Field field) {
    at -= at % sizeof(Field);
    if (at + sizeof field <= sizeof value) std::memcpy(reinterpret_cast<unsigned char*>(&value) + at, &field, sizeof field);
  }

  const uint8_t* data_;
  size_t left_;
};
