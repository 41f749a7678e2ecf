// SPDX-License-Identifier: Apache-2.0
// One eye's imager, from irradiance to counts: the stages of simsense_signal, row by row; stages at neutral values are skipped.
// cpu/signal/imager.h and vulkan/signal/imager.h run it. Thread rule: immutable.
#pragma once

#include "signal/gamma_quantile.h"
#include "simsense/simsense.h"

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT with the eye, the name, the value and the range of the first parameter that cannot be.
void check_signal(const simsense_signal& signal, const char* eye);

class Imager {
 public:
  /// signal has been checked. Gamma tables, which take milliseconds, are taken from `former` where it has the same speckle.
  explicit Imager(const simsense_signal& signal = simsense_signal_init(), const Imager* former = nullptr);

  [[nodiscard]] const simsense_signal& signal() const { return signal_; }
  [[nodiscard]] bool is_wide() const { return signal_.bit_depth > 8; }
  /// Factors of the speckle's parts; empty where there is no such part.
  [[nodiscard]] const GammaTable& static_speckle() const { return static_speckle_; }
  [[nodiscard]] const GammaTable& temporal_speckle() const { return temporal_speckle_; }
  /// Full wells overflow into their column.
  [[nodiscard]] bool blooms() const { return signal_.full_well_e > 0 && signal_.blooming > 0; }
  /// 8-bit images come out as they go in.
  [[nodiscard]] bool is_neutral() const { return is_neutral_; }

 private:
  simsense_signal signal_;
  GammaTable static_speckle_, temporal_speckle_;
  bool is_neutral_;
};

}  // namespace simsense
