#include "device/struct_read.h"

#include <algorithm>
#include <cstring>

namespace ks {

const ks_header* check_header(const void* from, uint32_t type, const char* name) {
  constexpr uint32_t longest = 1u << 16;  // far beyond any struct; keeps a header of garbage from being followed
  if (from == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
  const auto* header = static_cast<const ks_header*>(from);
  if (header->type != type)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s has struct type 0x%x, expected 0x%x: fill it with its _init function", name, header->type, type);
  if (header->size_bytes < sizeof(ks_header) || header->size_bytes > longest)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s says it is %u bytes long: fill it with its _init function", name, header->size_bytes);
  return header;
}

void read_struct_bytes(const void* from, uint32_t type, const char* name, void* out, size_t size_bytes) {
  const ks_header* header = check_header(from, type, name);
  if (header->next != nullptr)
    fail(KS_ERROR_UNSUPPORTED, "%s chains a struct of type 0x%x that this version does not know", name, header->next->type);
  const auto* bytes = static_cast<const unsigned char*>(from);
  for (size_t i = size_bytes; i < header->size_bytes; ++i)
    if (bytes[i] != 0)
      fail(KS_ERROR_VERSION, "%s uses a field at byte %zu that this library (%zu bytes) does not know: update the library", name, i,
           size_bytes);
  std::memset(out, 0, size_bytes);
  std::memcpy(out, from, std::min<size_t>(header->size_bytes, size_bytes));
  static_cast<ks_header*>(out)->size_bytes = static_cast<uint32_t>(size_bytes);
}

void write_struct_bytes(void* to, uint32_t type, const char* name, const void* value, size_t size_bytes) {
  const uint32_t callers_bytes = check_header(to, type, name)->size_bytes;
  const size_t known = std::min<size_t>(callers_bytes, size_bytes);
  constexpr size_t body = sizeof(ks_header);  // the caller's header stays
  std::memcpy(static_cast<unsigned char*>(to) + body, static_cast<const unsigned char*>(value) + body, known - body);
  std::memset(static_cast<unsigned char*>(to) + known, 0, callers_bytes - known);
}

}  // namespace ks
