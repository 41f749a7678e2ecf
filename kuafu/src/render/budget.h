// How many samples the next round of a render takes, when time or noise says when to stop. Thread rule: plain data.
#pragma once

#include <cstdint>

#include "device/buffer.h"

namespace kuafu {

class Budget {
 public:
  /// At most `samples` of each of `pixels`. max_seconds and relative_error: 0 = none.
  Budget(uint32_t samples, uint32_t pixels, double max_seconds, double relative_error);

  /// Samples of the next round, 0 when nothing more is to be done. A noise budget alone depends on the errors alone: it is deterministic.
  [[nodiscard]] uint32_t next() const { return next_; }
  /// The round that next() gave is done, `seconds` after the call began; `all_samples` are in the images, with this relative error.
  void round_done(double seconds, uint32_t all_samples, double relative_error);
  [[nodiscard]] uint32_t done() const { return done_; }

 private:
  uint32_t samples_, next_, done_ = 0;
  double max_seconds_, relative_error_, seconds_ = 0;
};

/// Root of the mean variance of the pixels' means, over the mean radiance: its upper limit at 84 % confidence, for what the replicates of
/// few pixels, or rare bright samples, tell little about. Both images hold [pixels][channels] floats.
double relative_error(const ks::Buffer& variance, const ks::Buffer& radiance, uint64_t pixels, uint32_t channels);

}  // namespace kuafu
