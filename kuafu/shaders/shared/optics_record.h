// SPDX-License-Identifier: Apache-2.0
// The launch of one step of the optics over held images; read by GLSL and C++ (scalar layout).
#ifndef KUAFU_OPTICS_RECORD_H
#define KUAFU_OPTICS_RECORD_H

#include "shared/optics_fields.h"
#include "shared/wave.h"

#ifdef __cplusplus
namespace kuafu {
#endif

KUAFU_CONST optics_most_radius_px = 32u;        // of a circle of confusion
KUAFU_CONST optics_tile_px = 32u;               // on a side, of the point spread's tiles
KUAFU_CONST optics_most_tiled_radius_px = 8u;   // of a kernel: the memory that all devices have

/// Images are packed [view][row][column][channel].
struct OpticsPush {
  FloatArray from, to;
  FloatArray depth;  // [view][row][column], metres, 0 = nothing hit
  FloatArray rows;   // one word per view, row and channel; then one per view and channel
  OpticsArray optics;   // one per view
  FloatArray kernels;
  FloatArray direct;  // the projector's direct light, for fireflies
  uint step, count;  // optics_*; invocations
  uint width, height, channels, view_count;
};

#ifdef __cplusplus
static_assert(sizeof(OpticsPush) == 80);
}  // namespace kuafu
#endif
#endif
