// SPDX-License-Identifier: Apache-2.0
// An image argument of a compute call made reachable by the host: in place where the memory is mapped or the caller's own, else through a
// counted copy. Thread rule: externally synchronised.
#pragma once

#include <memory>
#include <vector>

#include "image/layout.h"
#include "image/view.h"

namespace simsense {

class HostImage {
 public:
  /// Checks shape, bounds and pointers; throws KS_ERROR_INVALID_ARGUMENT with `name` first. Reads a buffer that is not mapped.
  HostImage(const ks::Device& device, const ImageArgument& argument, const ImageShape& shape, const char* name);

  [[nodiscard]] uint32_t format() const { return layout_.image.format; }
  [[nodiscard]] ConstPlane input(uint32_t batch_index) const;
  [[nodiscard]] Plane output(uint32_t batch_index) const;
  [[nodiscard]] ptrdiff_t component_stride() const { return layout_.component_stride; }
  /// Whether a stage may write the image directly: packed rows of one-component, aligned elements.
  [[nodiscard]] bool is_packed() const;
  /// Copies an output back to its buffer if that is not mapped.
  void commit();

 private:
  void reach_buffer(const char* name);

  ImageLayout layout_;
  std::shared_ptr<ks::Buffer> buffer_;
  std::byte* first_ = nullptr;  // element (0, 0, 0)
  std::vector<std::byte> staging_;
  uint64_t staging_begin_ = 0;
};

}  // namespace simsense
