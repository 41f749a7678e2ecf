// SPDX-License-Identifier: Apache-2.0
// An image argument of a compute call made reachable by shaders: in place where it lies in a buffer of the device, else through a counted
// copy in memory that both see. Thread rule: externally synchronised.
#pragma once

#include <optional>
#include <vector>

#include "image/layout.h"
#include "image/view.h"
#include "shared/image_ref.h"

namespace simsense {

/// Device memory for images in host memory, kept between calls.
class HostStaging {
 public:
  explicit HostStaging(std::shared_ptr<ks::Device> device) : device_(std::move(device)) {}
  std::shared_ptr<ks::Buffer> take(uint64_t bytes);
  /// Makes all memory free for the next call.
  void reset() { taken_ = 0; }
  [[nodiscard]] const std::shared_ptr<ks::Device>& device() const { return device_; }

 private:
  std::shared_ptr<ks::Device> device_;
  std::vector<std::shared_ptr<ks::Buffer>> buffers_;
  size_t taken_ = 0;
};

class DeviceImage {
 public:
  /// Checks shape, bounds and pointers; throws KS_ERROR_INVALID_ARGUMENT with `name` first.
  DeviceImage(HostStaging& staging, const ImageArgument& argument, const ImageShape& shape, const char* name);

  [[nodiscard]] uint32_t format() const { return layout_.image.format; }
  /// The images from batch_index on.
  [[nodiscard]] ImageRef ref(uint32_t batch_index) const;
  /// Whether a stage may use the images as its own arrays: no gaps between pixels, rows and images.
  [[nodiscard]] bool is_packed() const;
  [[nodiscard]] bool is_host() const { return host_ != nullptr; }
  [[nodiscard]] const std::shared_ptr<ks::Buffer>& buffer() const { return buffer_; }
  /// Copies between host and device memory; does nothing if they are the same.
  void load();
  void commit();

 private:
  template <class Copy>
  void each_row(const Copy& copy) const;

  ImageLayout layout_;
  std::shared_ptr<ks::Buffer> buffer_;
  std::byte* host_ = nullptr;  // element (0, 0, 0) of an image in host memory, whose packed copy is buffer_
  uint64_t begin_ = 0;         // lowest byte in the buffer
  ptrdiff_t first_ = 0;        // element (0, 0, 0), from there on
};

using DeviceFrame = FrameOf<DeviceImage>;

inline ImageRef ref_or_none(const std::optional<DeviceImage>& image, const Pairs& pairs) {
  return image ? image->ref(pairs.first) : ImageRef{};
}

/// Returns the image if a stage can use it as its own array: packed, and of the stage's format; else nothing.
inline std::optional<ImageRef> packed_ref(const std::optional<DeviceImage>& image, const Pairs& pairs, uint32_t format) {
  if (!image || image->format() != format || !image->is_packed()) return std::nullopt;
  return image->ref(pairs.first);
}

}  // namespace simsense
