// SPDX-License-Identifier: Apache-2.0
// What the matcher's compute stages share, read by GLSL and C++ (scalar layout): the arrays of one chunk of image pairs and the parameters
// that need no pipeline of their own.
#ifndef SIMSENSE_MATCH_PUSH_H
#define SIMSENSE_MATCH_PUSH_H
#include "shared/choices.h"

#ifdef __cplusplus
#include <cstdint>
namespace simsense {
using uint = uint32_t;
using UintArray = uint64_t;  // device address
using FloatArray = uint64_t;
using ByteArray = uint64_t;
#else
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer UintArray { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer FloatArray { float at[]; };
#extension GL_EXT_shader_8bit_storage : require
layout(buffer_reference, scalar, buffer_reference_align = 1) buffer ByteArray { uint8_t at[]; };
#endif

#ifdef __cplusplus
inline constexpr uint left_margin = 64;
#else
const uint left_margin = 64u;  // a path reads a little before and after its line
#endif

/// [P] pairs of one chunk, at most the batch's. A volume holds one element per pixel and disparity, in the order that lib/lanes.glsl tells.
/// Column c of the right image stands for its column c - min_disparity, the nearest one where there is none: a path that looks for
/// disparities from 0 on finds those from min_disparity on.
struct CensusPush {
  UintArray left_image, right_image;  // [P][height][image_pitch] elements; pixel 0 is byte left_byte (right_byte) of the first word
  UintArray left_census;              // [P][height][width], each of census_words words
  UintArray right_census;             // [copies][P][height][right_pitch]; column c of copy s stands at right_origin + s + c
  UintArray gray;                     // [P][height][width] the left image, where penalties heed it
  UintArray right_winner;             // as below; filled with its largest value
  uint left_byte, right_byte;
  uint image_pitch, image_stride;  // elements from row to row, from image to image
  uint width, height;
  uint right_pitch, right_origin, right_copy_words;
  int min_disparity;
};

/// Costs and paths.
struct PathPush {
  UintArray left_census, right_census, gray;
  UintArray cost;                     // volume of block sums, 16 bit; unused where costs come from census words
  UintArray first_sums, second_sums;  // volumes of path costs, each the sum of opposite paths: rows and columns, or both kinds of diagonals
  uint width, height;
  uint right_origin, right_pitch, right_copy_words;
  uint p1, p2;               // times the block's area
  uint p2_full_gradient_dn;  // counts
};

/// Winners and what follows. A block's costs around the winner come from their volume, or from census words.
struct WinnerPush {
  UintArray sums[4];  // volumes of path costs, as many as the pipeline was built for
  UintArray cost;
  UintArray left_census, right_census;
  UintArray right_winner;  // [P][height][width] least of cost << 16 | disparity
  FloatArray unchecked;    // [P][height][width] disparities before the left-right check
  FloatArray confidence;   // [P][height][width], if MAPS_CONFIDENCE
  uint width, height;
  uint right_origin, right_pitch;
  int min_disparity;
  uint maps;  // MAPS_*
};

struct MedianPush {
  UintArray right_winner;
  FloatArray unchecked;
  FloatArray disparity;   // [P][height][width]
  FloatArray confidence;  // [P][height][width], if MAPS_CONFIDENCE
  ByteArray reason;       // [P][height][width], if MAPS_REASON
  uint width, height;
  int lr_max_diff;  // -1 = off
  int min_disparity;
  uint maps;  // MAPS_*
};

#ifdef __cplusplus
static_assert(sizeof(CensusPush) <= 128 && sizeof(PathPush) <= 128 && sizeof(WinnerPush) <= 128, "the least that Vulkan grants");
}  // namespace simsense
#endif
#endif
