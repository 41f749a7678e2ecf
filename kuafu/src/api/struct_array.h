// Structs that stand in arrays or inside other structs of the C API.
#pragma once

#include "device/struct_read.h"

namespace kuafu {

/// Element i; arrays of structs have the stride that the caller compiled with.
template <class T>
T element(const T* first, uint32_t i, uint32_t type, const char* name) {
  const size_t stride = ks::check_header(first, type, name)->size_bytes;
  return ks::read_struct(reinterpret_cast<const T*>(reinterpret_cast<const unsigned char*>(first) + i * stride), type, name);
}

/// A struct inside another cannot grow by itself: its length must be ours.
template <class T>
void check_embedded(const T& value, uint32_t type, const char* name) {
  const ks_header* header = ks::check_header(&value, type, name);
  if (header->size_bytes != sizeof(T))
    ks::fail(KS_ERROR_VERSION, "%s is %u bytes long, this library knows %zu: use headers and library of one version", name,
             header->size_bytes, sizeof(T));
  if (header->next != nullptr)
    ks::fail(KS_ERROR_UNSUPPORTED, "%s chains a struct of type 0x%x that is not known here", name, header->next->type);
}

}  // namespace kuafu
