// SPDX-License-Identifier: Apache-2.0
// Radiance as sRGB in bytes, with the same bytes on every device: the curve and the exposures are tables, and light is counted by its bits.
// Thread rule: externally synchronised.
#pragma once

#include "frame/device_array.h"
#include "frame/image_step.h"
#include "shared/srgb_record.h"

namespace kuafu {

class SrgbEncoder {
 public:
  explicit SrgbEncoder(Memory memory);

  /// Converts radiance to sRGB. radiance: address of `views` packed images of three channels. to.scale is the exposure; 0 sets the median
  /// green of all views' lit pixels to a quarter of white.
  void run(ks::Commands& commands, uint64_t radiance, const OutputRecord& to, uint32_t views, uint32_t width, uint32_t height);

 private:
  Memory memory_;
  MappedTable<uint32_t> curve_;
  MappedTable<float> exposures_;
  std::shared_ptr<ks::Buffer> lights_;
  ImageStep<SrgbPush> step_;
};

namespace host {
/// Runs stage `srgb` on the host. Thread rule: any thread; ranges of a step are independent.
void srgb(const SrgbPush& push, uint32_t first, uint32_t end);
}  // namespace host

}  // namespace kuafu
