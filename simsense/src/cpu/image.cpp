// SPDX-License-Identifier: Apache-2.0
#include "cpu/frame.h"

namespace simsense {

HostImage::HostImage(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name)
    : layout_(check_layout(device, argument, shape, name)), buffer_(argument.buffer) {
  if (buffer_) {
    reach_buffer(name);
  } else {
    first_ = static_cast<std::byte*>(argument.host) + layout_.image.offset_bytes;
  }
}

void HostImage::reach_buffer(const char* name) {
  const ks::ByteRange range = ks::check_image(layout_.image, buffer_->size_bytes(), name);
  if (buffer_->mapped()) {
    first_ = static_cast<std::byte*>(buffer_->mapped()) + layout_.image.offset_bytes;
    return;
  }
  staging_.resize(range.end - range.begin);
  staging_begin_ = range.begin;
  buffer_->read(range.begin, staging_.data(), staging_.size());
  first_ = staging_.data() + (layout_.image.offset_bytes - range.begin);
}

ConstPlane HostImage::input(uint32_t batch_index) const {
  return {first_ + batch_index * layout_.batch_stride, layout_.row_stride, layout_.pixel_stride, layout_.image.format};
}

Plane HostImage::output(uint32_t batch_index) const {
  return {first_ + batch_index * layout_.batch_stride, layout_.row_stride, layout_.pixel_stride};
}

bool HostImage::is_packed() const {
  const auto element = static_cast<ptrdiff_t>(ks_format_bytes(layout_.image.format));
  const bool aligned = reinterpret_cast<uintptr_t>(first_) % static_cast<uintptr_t>(element) == 0 && layout_.batch_stride % element == 0;
  return aligned && layout_.has_packed_rows();
}

void HostImage::commit() {
  if (!staging_.empty()) buffer_->write(staging_begin_, staging_.data(), staging_.size());
}

}  // namespace simsense
