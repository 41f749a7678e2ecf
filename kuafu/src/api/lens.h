// SPDX-License-Identifier: Apache-2.0
// A public lens as the scene has it, and back. Thread rule: pure functions.
#pragma once

#include <algorithm>

#include "ks/lens.h"
#include "scene/distortion.h"

namespace kuafu {

inline Distortion to_distortion(const ks_lens& lens) {
  Distortion out{lens.model, {}};
  std::ranges::copy(lens.distortion, out.k.begin());
  return out;
}

inline ks_lens to_lens(const Distortion& distortion) {
  ks_lens out{.model = distortion.model, .reserved = 0, .distortion = {}};
  std::ranges::copy(distortion.k, out.distortion);
  return out;
}

}  // namespace kuafu
