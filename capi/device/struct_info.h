// SPDX-License-Identifier: Apache-2.0
// What the tables say of a public struct; struct_table.h has it for each (capi/generation).
#pragma once

#include <cstdint>

namespace ks {

/// Bytes of a struct that must be zero.
struct ReservedBytes {
  uint32_t offset;
  uint32_t size;
};

/// reserved: what must be zero.
template <class T>
struct StructInfo;

}  // namespace ks
