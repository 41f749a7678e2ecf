// SPDX-License-Identifier: Apache-2.0
// What the stages that follow the matcher on disparities share, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_CLEAN_PUSH_H
#define SIMSENSE_CLEAN_PUSH_H
#include "shared/choices.h"
#include "shared/image_ref.h"

// Passes of the speckle filter after that of its tiles, in their order.
#define SPECKLE_TILE 32u  // on a side
#define SPECKLE_JOIN 0u
#define SPECKLE_COUNT 1u
#define SPECKLE_DROP 2u
#define SPECKLE_PASSES 3u

// Passes of the filling of holes.
#define HOLES_PASS_GUESS 0u
#define HOLES_PASS_WRITE 1u
#define HOLES_PASS_COUNT 2u

// Passes of the check of edges.
#define EDGES_PASS_MARK 0u
#define EDGES_PASS_DROP 1u
#define EDGES_PASS_COUNT 2u

#ifdef __cplusplus
namespace simsense {
using CleanFloats = uint64_t;
using CleanWords = uint64_t;
#else
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer CleanFloats { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer CleanWords { uint at[]; };
#endif

/// [pairs][height][width] maps of the matcher, packed.
struct CleanPush {
  CleanFloats disparity, confidence;
  BytesAddress reason;  // REASON_*
  CleanFloats x, y;     // padding stage: [height][width] where the rectified left pixels lie in their source
  CleanWords parent,
      size;  // speckle stages: [pairs][height][width] union-find of islands; hole filling: parent is its result, as floats; edges: marks
  uint width, height;
  uint maps;  // MAPS_*
  float invalid;
  uint step;            // SPECKLE_*, HOLES_PASS_* or EDGES_PASS_*: the pass of that stage
  float max_diff_px;    // edges: from which on there is a step
  uint max_size;        // edges: of the border
  uint filling;         // HOLES_*
  uint x0, y0, x1, y1;  // region whose holes are filled
};

#ifdef __cplusplus
static_assert(sizeof(CleanPush) == 104);
}  // namespace simsense
#endif
#endif
