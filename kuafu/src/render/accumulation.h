// SPDX-License-Identifier: Apache-2.0
// An accumulation keeps the sums of whole images between the rounds of a budget, and between calls that accumulate.
// Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "frame/device_array.h"
#include "shared/wave.h"

namespace kuafu {

class Accumulation {
 public:
  /// A later call can add to the sums if it has the same shape.
  struct Shape {
    uint32_t views = 0, width = 0, height = 0, channels = 0, groups = 0;
    bool replicates = false, denoised = false;
    bool operator==(const Shape&) const = default;
  };

  explicit Accumulation(Memory memory) : memory_(std::move(memory)) {}

  /// Keeps the sums if `continues` is set and they have this shape; else starts again at `first_sample`.
  void begin(const Shape& shape, bool continues, uint32_t first_sample) {
    if (continues && sums_ && shape == shape_) return;
    clear();
    shape_ = shape;
    first_sample_ = first_sample;
    const uint64_t planes = uint64_t(shape.channels) * (shape.groups + (shape.replicates ? replicate_count : 0));
    sums_ = ks::Buffer::create(memory_.device, planes * pixel_count() * 4, memory_.device->is_cpu() ? KS_BUFFER_HOST_VISIBLE : 0);
  }
  void add(uint32_t samples) { samples_ += samples; }
  /// Drops the sums and frees their memory.
  void clear() { *this = Accumulation(memory_); }

  [[nodiscard]] uint64_t address() const { return memory_.address(*sums_); }
  [[nodiscard]] uint32_t pixel_count() const { return shape_.views * shape_.width * shape_.height; }
  [[nodiscard]] uint32_t first_sample() const { return first_sample_; }
  [[nodiscard]] uint32_t samples() const { return samples_; }

 private:
  Memory memory_;
  Shape shape_;
  std::shared_ptr<ks::Buffer> sums_;
  uint32_t first_sample_ = 0, samples_ = 0;
};

}  // namespace kuafu
