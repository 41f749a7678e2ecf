// What the matcher's compute stages share, read by GLSL and C++ (scalar layout): the arrays of one chunk of image pairs and the parameters
// that need no pipeline of their own.
#ifndef SIMSENSE_MATCH_PUSH_H
#define SIMSENSE_MATCH_PUSH_H

#ifdef __cplusplus
#include <cstdint>
namespace simsense {
using uint = uint32_t;
using UintArray = uint64_t;  // device address
using FloatArray = uint64_t;
#else
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer UintArray { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer FloatArray { float at[]; };
#endif

#ifdef __cplusplus
inline constexpr uint left_margin = 64;
#else
const uint left_margin = 64u;  // a path reads a little before and after its line
#endif

/// [P] pairs of one chunk. A volume holds one element per pixel and disparity, in the order that lib/lanes.glsl tells.
struct MatchPush {
  UintArray left_image, right_image;  // [P][height][width] bytes; pixel 0 is byte left_byte (right_byte) of the first word
  UintArray left_census;              // [P][height][width]
  UintArray right_census;             // [copies][P][height][right_pitch]; pixel x of copy s stands at right_origin + s + x
  UintArray cost;                     // volume of block sums, 16 bit; unused where the block is one pixel
  UintArray horizontal, vertical;     // volumes of path costs, each the sum of two opposite paths
  UintArray right_winner;             // [P][height][width] least of cost << 16 | disparity
  FloatArray unchecked;               // [P][height][width] disparities before the left-right check
  FloatArray disparity;               // [P][height][width]
  uint left_byte, right_byte;
  uint width, height;
  uint right_pitch, right_origin, right_copy_words;
  uint p1, p2;      // times the block's area
  int lr_max_diff;  // -1 = off
  uint segments;    // parts of a row that the winner stage sweeps side by side
  uint reserved;
};

#ifdef __cplusplus
static_assert(sizeof(MatchPush) == 128, "the least that Vulkan grants");
}  // namespace simsense
#endif
#endif
