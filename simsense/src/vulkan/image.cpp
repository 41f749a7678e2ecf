// SPDX-License-Identifier: Apache-2.0
#include "vulkan/frame.h"

#include <algorithm>
#include <cstring>

#include "device/error.h"

namespace simsense {
namespace {

ptrdiff_t element_bytes(const ImageLayout& layout) { return static_cast<ptrdiff_t>(ks_format_bytes(layout.image.format)); }

/// The same shape without gaps, for a copy of its own.
ImageLayout packed(ImageLayout layout) {
  const ImageShape& s = layout.shape;
  const ptrdiff_t element = element_bytes(layout), channels = static_cast<ptrdiff_t>(std::max<uint64_t>(s.channels, 1));
  layout.component_stride = s.channels ? element : 0;
  layout.pixel_stride = element * channels;
  layout.row_stride = layout.pixel_stride * static_cast<ptrdiff_t>(s.width);
  layout.batch_stride = layout.row_stride * static_cast<ptrdiff_t>(s.height);
  layout.image.offset_bytes = 0;
  return layout;
}

/// SPIR-V takes an array's index as a signed 32-bit number.
void check_reach(uint64_t elements, const char* name) {
  if (elements > INT32_MAX)
    ks::fail(KS_ERROR_UNSUPPORTED, "%s spans %llu elements, the Vulkan back end reaches 2^31 - 1: split the batch", name,
             static_cast<unsigned long long>(elements));
}

}  // namespace

std::shared_ptr<ks::Buffer> HostStaging::take(uint64_t bytes) {
  if (taken_ == buffers_.size()) buffers_.emplace_back();
  std::shared_ptr<ks::Buffer>& buffer = buffers_[taken_++];
  if (!buffer || buffer->size_bytes() < bytes) buffer = ks::Buffer::create(device_, bytes, KS_BUFFER_HOST_VISIBLE);
  return buffer;
}

DeviceImage::DeviceImage(HostStaging& staging, const ImageArgument& argument, const ImageShape& shape, const char* name)
    : layout_(check_layout(*staging.device(), argument, shape, name)), buffer_(argument.buffer) {
  const auto element = static_cast<uint64_t>(element_bytes(layout_));
  if (!buffer_) {
    const uint64_t bytes = static_cast<uint64_t>(packed(layout_).batch_stride) * shape.batch;
    check_reach(bytes / element, name);
    host_ = static_cast<std::byte*>(argument.host) + layout_.image.offset_bytes;
    buffer_ = staging.take(bytes);
    return;
  }
  const ks::ByteRange range = ks::check_image(layout_.image, buffer_->size_bytes(), name);
  check_reach((range.end - range.begin) / element, name);
  begin_ = range.begin;
  first_ = static_cast<ptrdiff_t>((layout_.image.offset_bytes - range.begin) / element);
}

ImageRef DeviceImage::ref(uint32_t batch_index) const {
  const ImageLayout layout = is_host() ? packed(layout_) : layout_;
  const ptrdiff_t element = element_bytes(layout);
  const auto elements = [element](ptrdiff_t bytes) { return static_cast<int>(bytes / element); };
  const ptrdiff_t first = first_ + batch_index * (layout.batch_stride / element);
  return {buffer_->address() + begin_, layout.image.format,           static_cast<uint32_t>(first),     elements(layout.batch_stride),
          elements(layout.row_stride), elements(layout.pixel_stride), elements(layout.component_stride)};
}

bool DeviceImage::is_packed() const {
  const ImageLayout wanted = packed(layout_);
  return is_host() || (layout_.has_packed_rows() && (layout_.shape.batch == 1 || layout_.batch_stride == wanted.batch_stride));
}

/// copy(host's pixel, staging's pixel, bytes) for whole rows where the host's are packed, else element by element.
template <class Copy>
void DeviceImage::each_row(const Copy& copy) const {
  const ImageLayout to = packed(layout_);
  const ImageShape& s = layout_.shape;
  const bool whole_rows = layout_.pixel_stride == to.pixel_stride && layout_.component_stride == to.component_stride;
  auto* staged = static_cast<std::byte*>(buffer_->mapped());
  for (ptrdiff_t n = 0; n < static_cast<ptrdiff_t>(s.batch); ++n)
    for (ptrdiff_t y = 0; y < static_cast<ptrdiff_t>(s.height); ++y) {
      std::byte* row = host_ + n * layout_.batch_stride + y * layout_.row_stride;
      std::byte* staged_row = staged + n * to.batch_stride + y * to.row_stride;
      if (whole_rows) {
        copy(row, staged_row, static_cast<size_t>(to.row_stride));
        continue;
      }
      for (ptrdiff_t x = 0; x < static_cast<ptrdiff_t>(s.width); ++x)
        for (ptrdiff_t c = 0; c < static_cast<ptrdiff_t>(std::max<uint64_t>(s.channels, 1)); ++c)
          copy(row + x * layout_.pixel_stride + c * layout_.component_stride, staged_row + x * to.pixel_stride + c * to.component_stride,
               static_cast<size_t>(element_bytes(layout_)));
    }
  buffer_->device()->count_copy(static_cast<uint64_t>(to.batch_stride) * s.batch);
}

void DeviceImage::load() {
  if (is_host()) each_row([](const std::byte* host, std::byte* staged, size_t bytes) { std::memcpy(staged, host, bytes); });
}

void DeviceImage::commit() {
  if (is_host()) each_row([](std::byte* host, const std::byte* staged, size_t bytes) { std::memcpy(host, staged, bytes); });
}

}  // namespace simsense
