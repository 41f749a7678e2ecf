// SPDX-License-Identifier: Apache-2.0
// What the tables say of a public struct; struct_table.h has it for each (capi/generation).
#pragma once

#include <cstddef>
#include <cstdint>

namespace ks {

#define KS_FIELD_END(type, field) static_cast<uint32_t>(offsetof(type, field) + sizeof(type::field))

/// Bytes of a struct that must be zero.
struct ReservedBytes {
  uint32_t offset;
  uint32_t size;
};

/// ends: where each field ends, growing. reserved: what must be zero. neutral(): what the fields are that a caller's struct does not have.
template <class T>
struct StructInfo;

}  // namespace ks
