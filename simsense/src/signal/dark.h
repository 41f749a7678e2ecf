// SPDX-License-Identifier: Apache-2.0
// How temperature acts on an imager. Dark current doubles every few kelvins (Widenhorn et al., Temperature dependence of dark current in a
// CCD, SPIE 4669, 2002); the black level drifts.
#pragma once

#include <cmath>

#include "simsense/simsense.h"

namespace simsense {

/// The exposure at the reference temperature that gathers as much dark charge, seconds.
inline float dark_exposure_s(const simsense_signal& s) {
  return s.exposure_s * std::exp2((s.temperature_c - s.dark_reference_c) / s.dark_doubling_k);
}

inline float black_dn(const simsense_signal& s) {
  return s.black_level_dn + s.black_level_dn_per_k * (s.temperature_c - s.dark_reference_c);
}

inline float max_dn(const simsense_signal& s) { return static_cast<float>((1u << s.bit_depth) - 1); }

}  // namespace simsense
