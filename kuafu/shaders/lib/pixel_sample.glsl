// SPDX-License-Identifier: Apache-2.0
// Where a sample lies in its pixel, and the key of all that its path draws.
#ifndef KUAFU_PIXEL_SAMPLE_GLSL
#define KUAFU_PIXEL_SAMPLE_GLSL
#include "lib/sequence.glsl"
#include "shared/wave.h"

struct PixelSample {
  uint key, index;
  vec2 offset;  // from the pixel's centre, -0.5..0.5
};

/// replicates: samples are dealt to sequences of their own, see replicate_count.
PixelSample pixel_sample(uint view_key, uint pixel, uint index, bool replicates) {
  uint key = hash(view_key ^ hash(pixel));
  uint replicate = hash(key + (1u + index % replicate_count) * 0x9e3779b9u);
  key = replicates ? replicate : key;
  index = replicates ? index / replicate_count : index;
  return PixelSample(key, index, sample_2d(key, index, pair_pixel) - 0.5f);
}
#endif
