// One eye's imager, from irradiance to counts: the stages of simsense_signal, row by row; stages at neutral values are skipped.
// Thread rule: immutable; measure may run on several threads at once, and its result does not depend on the number of workers.
#pragma once

#include <optional>

#include "image_view.h"
#include "signal/gamma_quantile.h"
#include "signal/key.h"
#include "simsense/simsense.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT with the eye, the name, the value and the range of the first parameter that cannot be.
void check_signal(const simsense_signal& signal, const char* eye);

/// What falls on one imager, [height][width], KS_FORMAT_U8, U16 or F32.
struct Irradiance {
  ConstPlane all;
  std::optional<ConstPlane> laser;  // its part that has speckle; without one, all has
};

class Imager {
 public:
  /// signal has been checked. Gamma tables, which take milliseconds, are taken from `former` where it has the same speckle.
  explicit Imager(const simsense_signal& signal = simsense_signal_init(), const Imager* former = nullptr);

  [[nodiscard]] const simsense_signal& signal() const { return signal_; }
  [[nodiscard]] bool is_wide() const { return signal_.bit_depth > 8; }
  /// Factors of the speckle's parts; empty where there is no such part.
  [[nodiscard]] const GammaTable& static_speckle() const { return static_speckle_; }
  [[nodiscard]] const GammaTable& temporal_speckle() const { return temporal_speckle_; }
  /// 8-bit images come out as they go in.
  [[nodiscard]] bool is_neutral() const { return is_neutral_; }

  /// counts: packed [height][width], uint16_t where is_wide().
  template <class Count>
  void measure(const NoiseKey& key, const Irradiance& light, uint32_t width, uint32_t height, Count* counts, ks::ThreadPool& workers) const;

 private:
  simsense_signal signal_;
  GammaTable static_speckle_, temporal_speckle_;
  bool is_neutral_;
};

}  // namespace simsense
