// SPDX-License-Identifier: Apache-2.0
// Reads an extensible C struct from a caller, and writes one to it, where the caller may have been compiled against an older or newer
// header (rules in ks/header.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "device/error.h"
#include "device/struct_info.h"
#include "ks/header.h"

namespace ks {

/// A struct as this library knows it.
struct KnownStruct {
  size_t size_bytes;
  std::span<const ReservedBytes> reserved;
};

template <class T>
KnownStruct known_struct() {
  return {sizeof(T), StructInfo<T>::reserved};
}

/// The caller's header, checked: right type and a length that a struct can have.
const ks_header* check_header(const void* from, uint32_t type, const char* name);

/// The untyped halves of what follows. Kept out of line: the compiler must not believe that the caller's struct is as long as ours.
void read_struct_bytes(const void* from, uint32_t type, const char* name, const KnownStruct& known, void* out);
void write_struct_bytes(void* to, uint32_t type, const char* name, const KnownStruct& known, const void* value);
void check_embedded_bytes(const void* value, uint32_t type, const char* name, const KnownStruct& known);

/// A copy in our layout; fields that an older caller does not have are 0.
template <class T>
[[nodiscard]] T read_struct(const T* from, uint32_t type, const char* name) {
  T out{};
  read_struct_bytes(from, type, name, known_struct<T>(), &out);
  return out;
}

/// Fills in a struct that the caller initialised: as much of it as the caller knows; what only the caller knows becomes zero.
template <class T>
void write_struct(T* to, const T& value, uint32_t type, const char* name) {
  write_struct_bytes(to, type, name, known_struct<T>(), &value);
}

/// A struct inside another cannot grow by itself: its length must be ours.
template <class T>
void check_embedded(const T& value, uint32_t type, const char* name) {
  check_embedded_bytes(&value, type, name, known_struct<T>());
}

/// Fills in a caller's struct of `size_bytes` from our initialised one.
void init_struct(void* out, uint32_t size_bytes, const void* value, size_t known_bytes);

}  // namespace ks
