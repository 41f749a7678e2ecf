// SPDX-License-Identifier: Apache-2.0
// Reads an extensible C struct from a caller, and writes one to it, where the caller may have been compiled against an older or newer
// header (rules in ks/header.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "device/error.h"
#include "ks/header.h"

namespace ks {

/// The bytes of a struct that must be zero.
struct ReservedBytes {
  uint32_t offset;
  uint32_t size;
};

/// The reserved bytes of a public struct, by the generated struct_table.h.
template <class T>
struct StructInfo;

/// A public struct as this library was compiled with it.
struct KnownStruct {
  size_t size_bytes;
  std::span<const ReservedBytes> reserved;
};

template <class T>
KnownStruct known_struct() {
  return {sizeof(T), StructInfo<T>::reserved};
}

/// Checks the caller's struct header: the right type and a possible length. Returns it.
const ks_header* check_header(const void* from, uint32_t type, const char* name);

/// The untyped halves of the functions below. They are not inlined: the compiler must not assume that the caller's struct is as long as
/// ours.
void read_struct_bytes(const void* from, uint32_t type, const char* name, const KnownStruct& known, void* out);
void write_struct_bytes(void* to, uint32_t type, const char* name, const KnownStruct& known, const void* value);
void check_embedded_bytes(const void* value, uint32_t type, const char* name, const KnownStruct& known);

/// Copies the caller's struct to our layout; fields that an older caller lacks are 0.
template <class T>
[[nodiscard]] T read_struct(const T* from, uint32_t type, const char* name) {
  T out{};
  read_struct_bytes(from, type, name, known_struct<T>(), &out);
  return out;
}

/// Reads element i of an array of structs, whose stride is the caller's: its header may be older or newer than ours.
template <class T>
[[nodiscard]] T read_element(const T* first, uint32_t i, uint32_t type, const char* name) {
  const size_t stride = check_header(first, type, name)->size_bytes;
  return read_struct(reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(first) + i * stride), type, name);
}

/// Writes our struct to the caller's initialised one, up to the length that both know; the rest of the caller's becomes zero.
template <class T>
void write_struct(T* to, const T& value, uint32_t type, const char* name) {
  write_struct_bytes(to, type, name, known_struct<T>(), &value);
}

/// Checks that a struct inside another has our length: it cannot grow by itself.
template <class T>
void check_embedded(const T& value, uint32_t type, const char* name) {
  check_embedded_bytes(&value, type, name, known_struct<T>());
}

/// Initialises a caller's struct of `size_bytes` with our defaults.
void init_struct(void* out, uint32_t size_bytes, const void* value, size_t known_bytes);

}  // namespace ks
