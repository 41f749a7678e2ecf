// SPDX-License-Identifier: Apache-2.0
// One animated property over time (glTF 2.0 section 3.11 and appendix C). Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace kuafu {

struct Keyframes {
  enum class Interpolation : uint32_t { linear, step, cubic_spline };
  Interpolation interpolation = Interpolation::linear;
  bool quaternion = false;     // x y z w, interpolated along the sphere
  uint32_t width = 0;          // numbers of one value
  std::vector<float> times_s;  // ascending
  std::vector<float> values;   // a value for each time; cubic_spline: in-tangent, value, out-tangent
};

/// Computes the value, `width` numbers, at `time_s`. Before the first keyframe and after the last, theirs hold.
void value_at(const Keyframes& keyframes, double time_s, std::span<double> out);

}  // namespace kuafu
