// Reads an extensible C struct from a caller, and writes one to it, where the caller may have been compiled against an older or newer
// header (rules in ks/header.h).
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "device/error.h"
#include "ks/header.h"

namespace ks {

/// The caller's header, checked: right type and a length that a struct can have.
const ks_header* check_header(const void* from, uint32_t type, const char* name);

/// The untyped halves of read_struct and write_struct. Kept out of line: the compiler must not believe that the caller's struct is as long
/// as ours.
void read_struct_bytes(const void* from, uint32_t type, const char* name, void* out, size_t size_bytes);
void write_struct_bytes(void* to, uint32_t type, const char* name, const void* value, size_t size_bytes);

/// A copy in our layout; fields that an older caller does not have are zero.
template <class T>
[[nodiscard]] T read_struct(const T* from, uint32_t type, const char* name) {
  T out;
  read_struct_bytes(from, type, name, &out, sizeof(T));
  return out;
}

/// The same over `defaults`: fields that an older caller does not have keep their value there.
template <class T>
[[nodiscard]] T read_struct(const T* from, uint32_t type, const char* name, const T& defaults) {
  const T given = read_struct(from, type, name);
  T out = defaults;
  std::memcpy(&out, &given, std::min<size_t>(check_header(from, type, name)->size_bytes, sizeof(T)));
  return out;
}

/// Fills in a struct that the caller initialised: as much of it as the caller knows; what only the caller knows becomes zero.
template <class T>
void write_struct(T* to, const T& value, uint32_t type, const char* name) {
  write_struct_bytes(to, type, name, &value, sizeof(T));
}

}  // namespace ks
