// An image argument of a compute call made reachable by the host: in place where the memory is mapped or the caller's own, else through a
// counted copy. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <vector>

#include "device/buffer.h"
#include "image_view.h"
#include "ks/image.h"

namespace simsense {

/// A strided view on a buffer, or on the caller's memory where buffer is empty.
struct ImageArgument {
  std::shared_ptr<ks::Buffer> buffer;
  void* host = nullptr;
  ks_image_desc image{};
};

/// What an image must be: [batch][height][width] or [batch][height][width][channels]; the batch dimension may be missing when it is 1.
struct ImageShape {
  uint64_t batch = 1, height = 0, width = 0, channels = 0;  // channels 0: no such dimension
};

class ImageAccess {
 public:
  /// Checks shape, bounds and pointers; throws KS_ERROR_INVALID_ARGUMENT that starts with `name`. Reads unmapped memory.
  ImageAccess(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name);

  [[nodiscard]] uint32_t format() const { return image_.format; }
  [[nodiscard]] ConstPlane input(uint32_t batch_index) const;
  [[nodiscard]] Plane output(uint32_t batch_index) const;
  [[nodiscard]] ptrdiff_t component_stride() const { return component_stride_; }
  /// Densely packed rows of one-component elements, aligned for them: a stage may write there itself.
  [[nodiscard]] bool is_packed() const;
  /// Writes an unmapped output back.
  void commit();

 private:
  void reach_buffer(const ks::Device& device, const char* name);

  std::shared_ptr<ks::Buffer> buffer_;
  ks_image_desc image_;
  uint64_t width_;
  std::byte* first_ = nullptr;  // element (0, 0, 0)
  ptrdiff_t batch_stride_ = 0, row_stride_ = 0, pixel_stride_ = 0, component_stride_ = 0;
  std::vector<std::byte> staging_;
  uint64_t staging_begin_ = 0;
};

}  // namespace simsense
