// SPDX-License-Identifier: Apache-2.0
// The numbers of the refinement (match/refine.h) and what its passes on a GPU share, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_REFINE_PUSH_H
#define SIMSENSE_REFINE_PUSH_H
#include "shared/match_push.h"

#define REFINE_PHASES 32                  // places between two columns
#define REFINE_LARGEST_DIFFERENCE 1536    // of two images' counts, 48ths of a count of 8 bits
#define REFINE_REACH 5                    // a window has 11 x 11 pixels
#define REFINE_WINDOW_SHARE 0.008264463f  // 1 / 121
#define REFINE_WINDOW_PRIOR 3872.0f       // 1/2 DN^2/px^2 per pixel: where the texture has no more, it decides by half
#define REFINE_CELL 16                    // px; of its rows every second one is read
#define REFINE_CELL_SHARE 0.0078125f      // 1 / 128
#define REFINE_CELL_FIGURES 5             // sums of g e, g w, u g e, u g w and u g u w, less what a constant makes of them
#define REFINE_CELL_PRIOR 400.0f          // 0.005 DN^2/px^2 per pixel of 3 x 3 cells: as REFINE_WINDOW_PRIOR
#define REFINE_PULL_RIDGE 0.0625f         // share of a pull's texture that is added to it: a step explains what either could
#define REFINE_PULL_UNIT 0.125f           // of u
#define REFINE_LARGEST_STEP 0.5f          // px

#ifdef __cplusplus
namespace simsense {
using EvidenceArray = uint64_t;
#else
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer EvidenceArray { uvec2 at[]; };
#endif

struct RefinePush {
  UintArray left_image, right_image;  // as CensusPush has them
  FloatArray filtered;                // [P][height][width] disparities after the median
  FloatArray cells;                   // [P][cell rows][cell columns][REFINE_CELL_FIGURES]
  EvidenceArray evidence;             // [P][height][width] of pixels that have moved with their cells
  FloatArray disparity;               // [P][height][width]
  uint left_byte, right_byte, image_pitch, image_stride;
  uint width, height;
  uint left_bits, right_bits;
  int min_disparity;
  float invalid;
};

#ifdef __cplusplus
static_assert(sizeof(RefinePush) <= 128, "the least that Vulkan grants");
}  // namespace simsense
#endif
#endif
