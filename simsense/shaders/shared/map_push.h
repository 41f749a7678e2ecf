// SPDX-License-Identifier: Apache-2.0
// What the stages on all maps of the matcher share, read by GLSL and C++ (scalar layout).
#ifndef SIMSENSE_MAP_PUSH_H
#define SIMSENSE_MAP_PUSH_H
#include "shared/choices.h"
#include "shared/depth_push.h"

// Sizes of the check of texture (src/checks/checks.h), pixels.
#define TEXTURE_SIDE 31u
#define TEXTURE_EDGE 5u

// Its passes.
#define TEXTURE_PASS_FIND 0u
#define TEXTURE_PASS_ROWS 1u
#define TEXTURE_PASS_DROP 2u
#define TEXTURE_PASS_COUNT 3u

#ifdef __cplusplus
namespace simsense {
using MapFloats = uint64_t;
#else
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer MapFloats { float at[]; };
#endif

/// From the maps of the part that was matched to those of the whole image: what lies outside [x0, x1) x [y0, y1) was not computed.
struct PlacePush {
  MapFloats part_disparity, part_confidence;  // [pairs][part_height][part_width], whose pixel (0, 0) is (part_x, part_y)
  BytesAddress part_reason;
  MapFloats disparity, confidence;  // [pairs][height][width]
  BytesAddress reason;
  uint part_width, part_height, part_x, part_y;
  uint width, height;
  uint x0, y0, x1, y1;
  uint maps;  // MAPS_*
  float invalid;
};

/// The check for too little texture of the left image (cpu/checks/checks.h).
struct TexturePush {
  MapFloats disparity, confidence;  // [pairs][height][width]
  BytesAddress reason;
  BytesAddress blank;      // [pairs][height][width] whether the square about a pixel is blank
  BytesAddress row_blank;  // whether that of a pixel near it in its row is
  ImageRef left;           // what the matcher saw
  uint width, height;
  uint min_texture_dn;
  uint step;  // TEXTURE_PASS_*
  uint maps;  // MAPS_*
  float invalid;
};

/// Why pixels have no depth (cpu/checks/checks.h).
struct ReasonPush {
  DepthBlockAddress block;
  DepthFloats disparity;
  BytesAddress reason;
  ImageRef left;  // what the matcher saw
  uint window_width, window_height;
  uint low_texture_dn, saturated_dn;
};

#ifdef __cplusplus
static_assert(sizeof(PlacePush) == 96 && sizeof(TexturePush) == 96 && sizeof(ReasonPush) == 72);
}  // namespace simsense
#endif
#endif
