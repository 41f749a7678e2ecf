// SPDX-License-Identifier: Apache-2.0
// One camera's imager, from irradiance to counts: the stages of simsense_signal, row by row; stages at neutral values are skipped.
// cpu/signal/imager.h and vulkan/signal/imager.h run it. Thread rule: immutable.
#pragma once

#include <cmath>
#include <vector>

#include "signal/gamma_quantile.h"
#include "simsense/simsense.h"

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT for the first invalid parameter, with side, name, value and range.
void check_signal(const simsense_signal& signal, const char* side);

/// Returns the parameters of a measured imager, by its name in simsense.h. Throws KS_ERROR_INVALID_ARGUMENT with the known names.
simsense_signal signal_preset(const char* name);

/// The exposure at the reference temperature, seconds, that gathers the same dark charge. Dark current doubles every few kelvins (Widenhorn
/// et al., Temperature dependence of dark current in a CCD, SPIE 4669, 2002).
inline float dark_exposure_s(const simsense_signal& s) {
  return s.exposure_s * std::exp2((s.temperature_c - s.dark_reference_c) / s.dark_doubling_k);
}

/// The black level at the sensor's temperature, DN.
inline float black_dn(const simsense_signal& s) {
  return s.black_level_dn + s.black_level_dn_per_k * (s.temperature_c - s.dark_reference_c);
}

inline float max_dn(const simsense_signal& s) { return static_cast<float>((1u << s.bit_depth) - 1); }

/// A count of all bits as images have it: 8 bits, halves to even.
constexpr uint8_t image_count(uint32_t count, uint32_t extra_bits) {
  const uint32_t rounded = (count + ((1u << extra_bits) - 1) / 2 + (count >> extra_bits & 1)) >> extra_bits;
  return static_cast<uint8_t>(rounded < 255 ? rounded : 255);
}

/// Weights of speckle's grain, -radius..radius along one axis: neighbouring pixels share standard normals as a Gaussian PSF spreads them.
/// radius is 4 sigma, rounded up. The squares sum to 1, so each sum is N(0, 1) and keeps its quantiles; sums d pixels apart correlate by
/// exp(-d^2 / (4 sigma^2)).
std::vector<float> grain_kernel(float sigma_px);

class Imager {
 public:
  /// signal must have been checked. Takes the gamma tables, which cost milliseconds, from `former` if its speckle is the same.
  explicit Imager(const simsense_signal& signal = simsense_signal_init(), const Imager* former = nullptr);

  /// As the caller stated it.
  [[nodiscard]] const simsense_signal& stated() const { return stated_; }
  /// With counts and DN of all bits of the converter.
  [[nodiscard]] const simsense_signal& signal() const { return signal_; }
  [[nodiscard]] bool is_wide() const { return signal_.bit_depth > 8; }
  /// Factor tables of both parts of the speckle; empty for a part that does not occur.
  [[nodiscard]] const GammaTable& static_speckle() const { return static_speckle_; }
  [[nodiscard]] const GammaTable& temporal_speckle() const { return temporal_speckle_; }
  /// Whether full wells overflow along their column.
  [[nodiscard]] bool blooms() const { return signal_.full_well_e > 0 && signal_.blooming > 0; }
  [[nodiscard]] bool has_noise() const;
  /// Whether 8-bit images pass unchanged.
  [[nodiscard]] bool is_neutral() const { return is_neutral_; }

 private:
  simsense_signal stated_, signal_;
  GammaTable static_speckle_, temporal_speckle_;
  bool is_neutral_;
};

}  // namespace simsense
