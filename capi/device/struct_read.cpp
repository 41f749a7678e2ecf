// SPDX-License-Identifier: Apache-2.0
#include "device/struct_read.h"

#include <algorithm>
#include <cstring>

namespace ks {
namespace {

constexpr uint32_t longest = 1u << 16;  // far beyond any struct; keeps a header of garbage from being followed

const unsigned char* bytes_of(const void* from) { return static_cast<const unsigned char*>(from); }

void check_reserved(const void* from, uint32_t size_bytes, const char* name, const KnownStruct& known) {
  for (const ReservedBytes& r : known.reserved)
    for (uint32_t i = r.offset; i < std::min(r.offset + r.size, size_bytes); ++i)
      if (bytes_of(from)[i] != 0)
        fail(KS_ERROR_VERSION,
             "%s uses a field at byte %u that this library does not know: update the library, or fill it with its _init function", name, i);
}

}  // namespace

const ks_header* check_header(const void* from, uint32_t type, const char* name) {
  if (from == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
  const auto* header = static_cast<const ks_header*>(from);
  if (header->type != type)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s has struct type 0x%x, expected 0x%x: fill it with its _init function", name, header->type, type);
  // Every version of a struct ends at a multiple of 8: another length would cut a pointer in half.
  if (header->size_bytes < sizeof(ks_header) || header->size_bytes > longest || header->size_bytes % sizeof(void*) != 0)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s says it is %u bytes long: fill it with its _init function", name, header->size_bytes);
  return header;
}

void read_struct_bytes(const void* from, uint32_t type, const char* name, const KnownStruct& known, void* out) {
  const ks_header* header = check_header(from, type, name);
  const uint32_t size = header->size_bytes;
  for (size_t i = known.size_bytes; i < size; ++i)
    if (bytes_of(from)[i] != 0)
      fail(KS_ERROR_VERSION, "%s uses a field at byte %zu that this library (%zu bytes) does not know: update the library", name, i,
           known.size_bytes);
  check_reserved(from, size, name, known);
  std::memcpy(out, from, std::min<size_t>(size, known.size_bytes));
  static_cast<ks_header*>(out)->size_bytes = static_cast<uint32_t>(known.size_bytes);
}

void write_struct_bytes(void* to, uint32_t type, const char* name, const KnownStruct& known, const void* value) {
  const uint32_t callers_bytes = check_header(to, type, name)->size_bytes;
  const size_t written = std::min<size_t>(callers_bytes, known.size_bytes);
  constexpr size_t body = sizeof(ks_header);  // the caller's header stays
  std::memcpy(static_cast<unsigned char*>(to) + body, bytes_of(value) + body, written - body);
  std::memset(static_cast<unsigned char*>(to) + written, 0, callers_bytes - written);
}

void check_embedded_bytes(const void* value, uint32_t type, const char* name, const KnownStruct& known) {
  const ks_header* header = check_header(value, type, name);
  if (header->size_bytes != known.size_bytes)
    fail(KS_ERROR_VERSION, "%s is %u bytes long, this library knows %zu: use headers and library of one version", name, header->size_bytes,
         known.size_bytes);
  check_reserved(value, header->size_bytes, name, known);
}

void init_struct(void* out, uint32_t size_bytes, const void* value, size_t known_bytes) {
  if (out == nullptr) fail(KS_ERROR_INVALID_ARGUMENT, "out is NULL");
  if (size_bytes < sizeof(ks_header) || size_bytes > longest)
    fail(KS_ERROR_INVALID_ARGUMENT, "size_bytes is %u, which no struct has", size_bytes);
  const size_t given = std::min<size_t>(size_bytes, known_bytes);
  std::memcpy(out, value, given);
  std::memset(static_cast<unsigned char*>(out) + given, 0, size_bytes - given);
  static_cast<ks_header*>(out)->size_bytes = size_bytes;
}

}  // namespace ks
