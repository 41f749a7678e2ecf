// SPDX-License-Identifier: Apache-2.0
// Bounds of a strided view, in integers wide enough that no shape or stride can overflow them.
#include <cstdlib>

#include "device/buffer.h"
#include "device/error.h"
#include "ks/image.h"

namespace ks {
namespace {

using ull = unsigned long long;
__extension__ using u128 = unsigned __int128;

void check_form(const ks_image_desc& image, const char* name) {
  const uint32_t element_bytes = ks_format_bytes(image.format);
  if (element_bytes == 0) fail(KS_ERROR_INVALID_ARGUMENT, "%s: format %u is no KS_FORMAT_*", name, image.format);
  if (image.dim_count < 1 || image.dim_count > KS_MAX_DIMS)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s: dim_count is %u, it must be 1..%d", name, image.dim_count, KS_MAX_DIMS);
  for (uint32_t k = 0; k < image.dim_count; ++k)
    if (image.shape[k] == 0) fail(KS_ERROR_INVALID_ARGUMENT, "%s: shape[%u] is 0", name, k);
  bool aligned = image.offset_bytes % element_bytes == 0;
  for (uint32_t k = 0; k < image.dim_count; ++k) {
    if (image.shape[k] > 1 && image.byte_stride[k] == 0)
      fail(KS_ERROR_INVALID_ARGUMENT, "%s: byte_stride[%u] is 0 although shape[%u] is %llu", name, k, k, static_cast<ull>(image.shape[k]));
    aligned = aligned && (image.shape[k] == 1 || image.byte_stride[k] % static_cast<int64_t>(element_bytes) == 0);
  }
  if (!aligned) fail(KS_ERROR_INVALID_ARGUMENT, "%s: offset and strides must be multiples of the element's %u bytes", name, element_bytes);
}

}  // namespace

ByteRange check_image(const ks_image_desc& image, uint64_t size_bytes, const char* name) {
  check_form(image, name);
  // How far elements reach below and above offset_bytes. Each product is below 2^127; each sum stops at the first one beyond the buffer.
  u128 below = 0, above = ks_format_bytes(image.format);
  for (uint32_t k = 0; k < image.dim_count && below <= size_bytes && above <= size_bytes; ++k) {
    const int64_t stride = image.byte_stride[k];
    const uint64_t magnitude = stride < 0 ? -static_cast<uint64_t>(stride) : static_cast<uint64_t>(stride);
    (stride < 0 ? below : above) += static_cast<u128>(image.shape[k] - 1) * magnitude;
  }
  const uint64_t offset = image.offset_bytes;
  if (below > offset || offset > size_bytes || above > size_bytes - offset)
    fail(KS_ERROR_INVALID_ARGUMENT, "%s: the view (offset %llu, shape[0] %llu, byte_stride[0] %lld, %u dimensions) leaves its %llu bytes",
         name, static_cast<ull>(offset), static_cast<ull>(image.shape[0]), static_cast<long long>(image.byte_stride[0]), image.dim_count,
         static_cast<ull>(size_bytes));
  return {offset - static_cast<uint64_t>(below), offset + static_cast<uint64_t>(above)};
}

}  // namespace ks
