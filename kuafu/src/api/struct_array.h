// SPDX-License-Identifier: Apache-2.0
// Structs that stand in arrays of the C API.
#pragma once

#include "api/struct_table.h"
#include "device/struct_read.h"
#include "device/struct_table.h"

namespace kuafu {

/// Returns element i of an array of structs, whose stride is the caller's sizeof.
template <class T>
T element(const T* first, uint32_t i, uint32_t type, const char* name) {
  const size_t stride = ks::check_header(first, type, name)->size_bytes;
  return ks::read_struct(reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(first) + i * stride), type, name);
}

}  // namespace kuafu
