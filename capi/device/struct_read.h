// Reads an extensible C struct from a caller that may have been compiled against an older or newer header (rules in ks/header.h).
#pragma once

#include <algorithm>
#include <cstring>

#include "device/error.h"
#include "ks/header.h"

namespace ks {

template <class T>
[[nodiscard]] T read_struct(const T* from, uint32_t type, const char* name) {
  if (from == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
  const ks_header* header = reinterpret_cast<const ks_header*>(from);
  if (header->type != type)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s has struct type 0x%x, expected 0x%x: fill it with its _init function", name, header->type, type);
  if (header->size_bytes < sizeof(ks_header))
    fail(KS_ERROR_INVALID_ARGUMENT, "%s says it is %u bytes long, less than its header", name, header->size_bytes);
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

}  // namespace ks
