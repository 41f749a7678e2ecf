// SPDX-License-Identifier: Apache-2.0
// The numbers of the check by correlation (match/correlation.h) and what its passes on a GPU share, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_CORRELATION_PUSH_H
#define SIMSENSE_CORRELATION_PUSH_H
#include "shared/match_push.h"

#define CORRELATION_LARGEST 127  // 8ths of a count
#define CORRELATION_REACH 15     // of the largest window
#define CORRELATION_GROUP 16     // pixels of a workgroup's side
#define CORRELATION_RUN 4        // pixels of an invocation, one below the other, where sums move
#define CORRELATION_BARE 12      // px, the largest correlation_bare_reach()
#define CORRELATION_SHARE 0.04f  // of the wide window's correlation, which the near one must have, squared
#define CORRELATION_NOISE 2.25f  // standard deviations of the near one's noise, squared

#ifdef __cplusplus
namespace simsense {
#endif

/// One image of each pair: the right one, then the left one beside what its disparities meet.
struct HighPassPush {
  UintArray image;   // as CensusPush has it
  ByteArray high;    // of the right image, [P][height][width], signed
  ByteArray pairs;   // of the left one, [P][height][width rounded up to even][left, right], 0 without a disparity
  FloatArray found;  // [P][height][width] disparities
  float invalid;
  uint is_left;
  uint first_byte, image_pitch, image_stride;
  uint width, height;
  uint bits;       // of a count
  uint mean_side;  // px
  int part;        // correlation_part()
};

struct CorrelationPush {
  UintArray pairs;        // of the first pass, two to a word
  FloatArray found;       // [P][height][width] disparities
  UintArray bare;         // [P][height][workgroup of a row] the bits of its columns where the near window fails
  FloatArray disparity;   // the same, of which some go
  FloatArray confidence;  // if MAPS_CONFIDENCE
  ByteArray reason;       // if MAPS_REASON
  uint width, height;
  int reach, near_reach;  // of the windows
  uint bare_reach;
  float least, area;  // of a wide window's correlation; px of it
  float invalid;
  uint maps;  // MAPS_*
};

#ifdef __cplusplus
static_assert(sizeof(HighPassPush) <= 128 && sizeof(CorrelationPush) <= 128, "the least that Vulkan grants");
}  // namespace simsense
#endif
#endif
