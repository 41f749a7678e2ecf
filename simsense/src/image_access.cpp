#include "image_access.h"

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

ImageAccess::ImageAccess(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name)
    : buffer_(argument.buffer), image_(argument.image), width_(shape.width) {
  const bool batched = check_shape(image_, shape, name);
  check_strides(image_, name);
  const int64_t* stride = image_.byte_stride;
  if (batched) batch_stride_ = *stride++;
  row_stride_ = *stride++;
  pixel_stride_ = *stride++;
  if (shape.channels) component_stride_ = *stride;
  if (buffer_) {
    reach_buffer(device, name);
  } else {
    if (argument.host == nullptr) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s has neither a buffer nor a host pointer", name);
    first_ = static_cast<std::byte*>(argument.host) + image_.offset_bytes;
  }
}

void ImageAccess::reach_buffer(const ks::Device& device, const char* name) {
  if (buffer_->device().get() != &device)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s lies in a buffer of device '%s', the engine runs on '%s': import it there", name,
             buffer_->device()->info().name, device.info().name);
  const ks::ByteRange range = ks::check_image(image_, buffer_->size_bytes(), name);
  if (buffer_->mapped()) {
    first_ = static_cast<std::byte*>(buffer_->mapped()) + image_.offset_bytes;
    return;
  }
  staging_.resize(range.end - range.begin);
  staging_begin_ = range.begin;
  buffer_->read(range.begin, staging_.data(), staging_.size());
  first_ = staging_.data() + (image_.offset_bytes - range.begin);
}

ConstPlane ImageAccess::input(uint32_t batch_index) const {
  return {first_ + batch_index * batch_stride_, row_stride_, pixel_stride_, image_.format};
}

Plane ImageAccess::output(uint32_t batch_index) const { return {first_ + batch_index * batch_stride_, row_stride_, pixel_stride_}; }

bool ImageAccess::is_packed() const {
  const auto element = static_cast<ptrdiff_t>(ks_format_bytes(image_.format));
  const bool aligned = reinterpret_cast<uintptr_t>(first_) % static_cast<uintptr_t>(element) == 0 && batch_stride_ % element == 0;
  return component_stride_ == 0 && aligned && pixel_stride_ == element && row_stride_ == element * static_cast<ptrdiff_t>(width_);
}

void ImageAccess::commit() {
  if (!staging_.empty()) buffer_->write(staging_begin_, staging_.data(), staging_.size());
}

}  // namespace simsense
