// SPDX-License-Identifier: Apache-2.0
#include "image/layout.h"

#include <algorithm>
#include <string>

#include "device/device.h"
#include "device/error.h"

namespace simsense {
namespace {

std::string shape_text(const uint64_t* shape, uint32_t count) {
  std::string text = "[";
  for (uint32_t i = 0; i < count; ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + "]";
}

/// Throws unless the image has the wanted shape; returns whether its batch dimension is there.
bool check_shape(const ks_image_desc& image, const ImageShape& wanted, const char* name) {
  uint64_t full[4] = {wanted.batch, wanted.height, wanted.width, wanted.channels};
  const uint32_t full_count = wanted.channels ? 4 : 3;
  const auto matches = [&](const uint64_t* shape, uint32_t count) {
    return image.dim_count == count && std::equal(shape, shape + count, image.shape);
  };
  if (matches(full, full_count)) return true;
  if (wanted.batch == 1 && matches(full + 1, full_count - 1)) return false;
  if (image.dim_count > KS_MAX_DIMS)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has %u dimensions, at most %d are possible", name, image.dim_count, KS_MAX_DIMS);
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has shape %s, must be %s%s", name, shape_text(image.shape, image.dim_count).c_str(),
           shape_text(full, full_count).c_str(), wanted.batch == 1 ? " (the leading 1 may be left out)" : "");
}

void check_strides(const ks_image_desc& image, const char* name) {
  constexpr int64_t limit = int64_t{1} << 40;
  for (uint32_t k = 0; k < image.dim_count; ++k) {
    const int64_t stride = image.byte_stride[k];
    if (stride == 0 && image.shape[k] > 1)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: byte_stride[%u] is 0 with extent %llu: only an extent of 1 may have stride 0", name, k,
               static_cast<unsigned long long>(image.shape[k]));
    if (stride > limit || stride < -limit)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s: byte_stride[%u] is %lld: beyond 2^40", name, k, static_cast<long long>(stride));
  }
}

}  // namespace

ImageLayout check_layout(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name) {
  ImageLayout layout{argument.image, shape};
  const bool batched = check_shape(layout.image, shape, name);
  check_strides(layout.image, name);
  const int64_t* stride = layout.image.byte_stride;
  if (batched) layout.batch_stride = *stride++;
  layout.row_stride = *stride++;
  layout.pixel_stride = *stride++;
  if (shape.channels) layout.component_stride = *stride;
  if (!argument.buffer) {
    if (argument.host == nullptr) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has neither a buffer nor a host pointer", name);
    return layout;
  }
  if (argument.buffer->device().get() != &device)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s lies in a buffer of device '%s', the engine runs on '%s': import it there", name,
             argument.buffer->device()->info().name, device.info().name);
  (void)ks::check_image(layout.image, argument.buffer->size_bytes(), name);
  return layout;
}

}  // namespace simsense
