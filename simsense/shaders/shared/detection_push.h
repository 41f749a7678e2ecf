// SPDX-License-Identifier: Apache-2.0
// The numbers of the check for more than noise (match/detection.h) and what its passes on a GPU share, read by GLSL and C++ (scalar
// layout).
#ifndef SIMSENSE_DETECTION_PUSH_H
#define SIMSENSE_DETECTION_PUSH_H
#include "shared/match_push.h"

#define DETECTION_LARGEST 63        // 8ths of a count
#define DETECTION_MOST_NOISE 17000  // of a pixel, quarters of a squared 8th
#define DETECTION_NOISE_BITS 14     // of the noise's factors behind the binary point
#define DETECTION_OF_NOISE 1.14f    // energy of matched noise over that of noise
#define DETECTION_REACH 15          // of the largest window
#define DETECTION_GROUP 16          // pixels of a workgroup's side
#define DETECTION_RUN 4             // pixels of an invocation, one below the other, where sums move
#define DETECTION_BARE 20           // px, the largest detection_bare_reach()

#ifdef __cplusplus
namespace simsense {
#endif

/// (dark + per_count v + per_count2 v^2) >> DETECTION_NOISE_BITS, of both images, at least `least`; v: a count of 8 bits.
struct DetectionNoise {
  int dark, per_count, per_count2, least;
};

/// One image of each pair: the right one, then the left one beside what its disparities meet.
struct HighPassPush {
  UintArray image;   // as CensusPush has it
  ByteArray high;    // of the right image, [P][height][width], signed
  UintArray energy;  // of the left one, [P][height][width] DetectionSums' energy << 16 | noise, 0 without a disparity
  FloatArray found;  // [P][height][width] disparities
  DetectionNoise noise;
  float invalid;
  uint is_left;
  uint first_byte, image_pitch, image_stride;
  uint width, height;
  uint bits;       // of a count
  uint mean_side;  // px
  int part;        // detection_part()
};

struct DetectionPush {
  UintArray energy;       // of the first pass
  FloatArray found;       // [P][height][width] disparities
  UintArray bare;         // [P][height][workgroup of a row] the bits of its columns whose windows fail
  FloatArray disparity;   // the same, of which some go
  FloatArray confidence;  // if MAPS_CONFIDENCE
  ByteArray reason;       // if MAPS_REASON
  uint width, height;
  int reach;         // of the window
  uint bare_reach;   // detection_bare_reach()
  int most_matched;  // detection_most_matched()
  float least;       // standard deviations
  float invalid;
  uint maps;  // MAPS_*
};

#ifdef __cplusplus
static_assert(sizeof(HighPassPush) <= 128 && sizeof(DetectionPush) <= 128, "the least that Vulkan grants");
}  // namespace simsense
#endif
#endif
