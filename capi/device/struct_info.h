// SPDX-License-Identifier: Apache-2.0
// Facts of a public struct from its table; the generated struct_table.h specialises them (capi/generation).
#pragma once

#include <cstdint>

namespace ks {

/// The bytes of a struct that must be zero.
struct ReservedBytes {
  uint32_t offset;
  uint32_t size;
};

/// The reserved bytes of a public struct, by the generated struct_table.h.
template <class T>
struct StructInfo;

}  // namespace ks
