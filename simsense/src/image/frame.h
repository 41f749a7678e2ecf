// SPDX-License-Identifier: Apache-2.0
// The images of one compute call, inputs and outputs, as a back end reaches them (cpu/image.h, vulkan/image.h). Plain values.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "simsense/simsense.h"

namespace simsense {

constexpr uint32_t output_count = SIMSENSE_OUTPUT_POINTS_COLORED + 1;

/// A range of a batch's pairs.
struct Pairs {
  uint32_t first = 0, count = 0;
};

template <class Image>
struct FrameOf {
  std::optional<Image> inputs[2];
  std::optional<Image> lasers[2];
  std::optional<Image> rgb;
  std::array<std::optional<Image>, output_count> outputs;

  [[nodiscard]] bool wants(uint32_t output) const { return outputs[output].has_value(); }
  [[nodiscard]] bool wants_points() const { return wants(SIMSENSE_OUTPUT_POINTS) || wants(SIMSENSE_OUTPUT_POINTS_COLORED); }
  [[nodiscard]] bool wants_disparity() const {
    return wants(SIMSENSE_OUTPUT_DISPARITY) || wants(SIMSENSE_OUTPUT_DEPTH) || wants(SIMSENSE_OUTPUT_DEPTH_RGB) || wants_points() ||
           wants(SIMSENSE_OUTPUT_CONFIDENCE) || wants(SIMSENSE_OUTPUT_REASON);
  }
};

}  // namespace simsense
