// SPDX-License-Identifier: Apache-2.0
// What the stages from disparity to depth, registration and points share, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_DEPTH_PUSH_H
#define SIMSENSE_DEPTH_PUSH_H
#include "shared/image_ref.h"
#include "shared/lens.h"

#ifdef __cplusplus
namespace simsense {
using DepthBlockAddress = uint64_t;
using DepthFloats = uint64_t;
using DepthCells = uint64_t;
#else
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer DepthFloats { float at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer DepthCells { uint at[]; };
#endif

/// How far a splat of the largest size, 15, reaches: the z-buffer goes on that many pixels beyond each border of the image.
#define SPLAT_MARGIN 7

/// Parameters of depth/depth.h and registration/projection.h.
struct DepthParameters {
  DepthFloats ray_x, ray_y;  // of the points' camera at z = 1: one row and one column, or one per pixel
  DepthFloats row_starts;    // [height][3]: where each row's rays start in the RGB camera
  uint rays_per_pixel;       // nonzero: ray_x, ray_y are [height][width]
  uint width, height, rgb_width, rgb_height;
  float focal_baseline, offset_px, invalid;
  float min_m, max_m;
  uint splat_size, splat_reach, splat_invalid;
  float landing_margin;             // how far beyond the image's border points are kept, pixels, at most SPLAT_MARGIN
  float step[3], translation_m[3];  // of a ray from column to column; of the left camera
  float rgb_focal[2], rgb_centre[2];
  LensParameters lens;  // of the RGB camera
};

#ifndef __cplusplus
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer DepthBlockAddress { DepthParameters parameters; };
#endif

struct DepthPush {
  DepthBlockAddress block;
  DepthFloats disparity;          // [pairs][height][width] pixels, packed
  DepthCells nearest;             // [pairs][rgb_height + 2 SPLAT_MARGIN][rgb_width + 2 SPLAT_MARGIN] bits of the nearest z, or infinity
  ImageRef first, second, third;  // each stage says which; may be absent
};

#ifdef __cplusplus
static_assert(sizeof(DepthPush) == 120);
static_assert(sizeof(DepthParameters) % 4 == 0);
}  // namespace simsense
#endif
#endif
