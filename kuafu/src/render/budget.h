// SPDX-License-Identifier: Apache-2.0
// A budget says how many samples the next round of a render takes where a limit of time or noise ends it. Thread rule: plain data.
#pragma once

#include <cstdint>

#include "device/buffer.h"

namespace kuafu {

class Budget {
 public:
  /// Each of the `pixels` gets at most `samples`. A limit of 0 is none.
  Budget(uint32_t samples, uint32_t pixels, double max_seconds, double relative_error);

  /// The samples of the next round; 0 when the render is done. Without a limit of time they depend on the errors alone, so they are
  /// deterministic.
  [[nodiscard]] uint32_t next() const { return next_; }
  /// Call it after the round that next() gave: `seconds` have passed since the call began, and the images have `all_samples` and this
  /// relative error.
  void round_done(double seconds, uint32_t all_samples, double relative_error);
  [[nodiscard]] uint32_t done() const { return done_; }

 private:
  uint32_t samples_, next_, done_ = 0;
  double max_seconds_, relative_error_, seconds_ = 0;
};

/// The relative error of an image: the root of the mean variance of its pixels over its mean radiance. The function returns its upper limit
/// at 84 % confidence, since few pixels or rare bright samples tell little about the variance. Both images hold [pixels][channels] floats.
double relative_error(const ks::Buffer& variance, const ks::Buffer& radiance, uint64_t pixels, uint32_t channels);

}  // namespace kuafu
