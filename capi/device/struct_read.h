// Reads an extensible C struct from a caller, and writes one to it, where the caller may have been compiled against an older or newer
// header (rules in ks/header.h).
#pragma once

#include <algorithm>
#include <cstring>

#include "device/error.h"
#include "ks/header.h"

namespace ks {

/// The caller's header, checked: right type and a length that a struct can have.
inline const ks_header* check_header(const void* from, uint32_t type, const char* name) {
  constexpr uint32_t longest = 1u << 16;  // far beyond any struct; keeps a header of garbage from being followed
  if (from == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
  const auto* header = static_cast<const ks_header*>(from);
  if (header->type != type)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s has struct type 0x%x, expected 0x%x: fill it with its _init function", name, header->type, type);
  if (header->size_bytes < sizeof(ks_header) || header->size_bytes > longest)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s says it is %u bytes long: fill it with its _init function", name, header->size_bytes);
  return header;
}

template <class T>
[[nodiscard]] T read_struct(const T* from, uint32_t type, const char* name) {
  const ks_header* header = check_header(from, type, name);
  if (header->next != nullptr)
    fail(KS_ERROR_UNSUPPORTED, "%s chains a struct of type 0x%x that this version does not know", name, header->next->type);
  T out;
  std::memset(static_cast<void*>(&out), 0, sizeof(T));
  std::memcpy(static_cast<void*>(&out), from, std::min<size_t>(header->size_bytes, sizeof(T)));
  const auto* bytes = reinterpret_cast<const unsigned char*>(from);
  for (size_t i = sizeof(T); i < header->size_bytes; ++i)
    if (bytes[i] != 0)
      fail(KS_ERROR_VERSION, "%s uses a field at byte %zu that this library (%zu bytes) does not know: update the library", name, i,
           sizeof(T));
  out.header.size_bytes = sizeof(T);
  return out;
}

/// Fills in a struct that the caller initialised: as much of it as the caller knows; what only the caller knows becomes zero.
template <class T>
void write_struct(T* to, const T& value, uint32_t type, const char* name) {
  const ks_header kept = *check_header(to, type, name);
  const size_t known = std::min<size_t>(kept.size_bytes, sizeof(T));
  auto* bytes = reinterpret_cast<unsigned char*>(to);
  std::memcpy(bytes + sizeof(ks_header), reinterpret_cast<const unsigned char*>(&value) + sizeof(ks_header), known - sizeof(ks_header));
  std::memset(bytes + known, 0, kept.size_bytes - known);
}

}  // namespace ks
