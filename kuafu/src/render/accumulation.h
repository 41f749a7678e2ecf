// Sums of whole images between passes that are apart: the rounds of a budget, and calls that accumulate.
// Thread rule: externally synchronised.
#pragma once

#include <memory>

#include "frame/device_array.h"

namespace kuafu {

class Accumulation {
 public:
  /// Sums of one shape can go on.
  struct Shape {
    uint32_t views = 0, width = 0, height = 0, channels = 0, groups = 0;
    bool replicates = false, denoised = false;
    bool operator==(const Shape&) const = default;
  };

  explicit Accumulation(Memory memory) : memory_(std::move(memory)) {}

  /// Goes on where `continues` and the sums are of this shape, else starts at `first_sample`.
  void begin(const Shape& shape, bool continues, uint32_t first_sample);
  void add(uint32_t samples) { samples_ += samples; }
  /// What is there is lost, and its memory given back.
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
