// SPDX-License-Identifier: Apache-2.0
// Little-endian numbers out of a span that is never left. Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <span>

#include "device/error.h"

namespace kuafu {

/// Returns `count` bytes from `at` on. Throws KS_ERROR_FILE if there are fewer.
inline std::span<const uint8_t> part(std::span<const uint8_t> bytes, uint64_t at, uint64_t count) {
  if (at > bytes.size() || count > bytes.size() - at) ks::fail(KS_ERROR_FILE, "the data ends too early: it has %zu bytes", bytes.size());
  return bytes.subspan(at, count);
}

inline uint32_t u8(std::span<const uint8_t> bytes, uint64_t at) { return part(bytes, at, 1)[0]; }

inline uint32_t u16(std::span<const uint8_t> bytes, uint64_t at) {
  const auto p = part(bytes, at, 2);
  return p[0] | uint32_t{p[1]} << 8;
}

inline uint32_t u32(std::span<const uint8_t> bytes, uint64_t at) {
  const auto p = part(bytes, at, 4);
  return p[0] | uint32_t{p[1]} << 8 | uint32_t{p[2]} << 16 | uint32_t{p[3]} << 24;
}

}  // namespace kuafu
