// SPDX-License-Identifier: Apache-2.0
// How disparities lie in lanes and words. A cluster of path_lanes lanes holds one pixel's disparities, lane j the lane_disparities from
// j * lane_disparities on, as pairs: register k holds disparity k of the lane in its low and k + lane_pairs in its high 16 bits, so that a
// neighbouring disparity is a neighbouring register. A volume's element order follows from that and costs no shuffling:
//   1 byte:  word w = low of pair 2w, low of 2w + 1, high of 2w, high of 2w + 1        2 bytes: word k = pair k
//   4 bytes: words 2k, 2k + 1 = low and high of pair k
// Read backwards, words and elements, a lane's words are those of the mirrored order of disparities.
#ifndef SIMSENSE_LANES_GLSL
#define SIMSENSE_LANES_GLSL
#extension GL_EXT_control_flow_attributes : require
#extension GL_KHR_shader_subgroup_basic : require
#include "shared/match_constants.glsl"
#include "shared/match_push.h"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint path_lanes = 8u;         // power of two, at most the subgroup's size
layout(constant_id = 2) const uint lane_disparities = 16u;  // multiple of 4
layout(constant_id = 3) const uint subgroup_lanes = 8u;
layout(constant_id = 4) const uint sum_bytes = 1u;          // of a volume of path costs: 1, 2 or 4
layout(constant_id = 5) const uint steps = 4u;              // pixels read ahead: 4 or 8
layout(constant_id = 6) const uint subpixel = SUBPIXEL_EQUIANGULAR;
layout(constant_id = 7) const uint stored = 0u;             // nonzero: costs come from the volume push.cost, else from census words
layout(constant_id = 8) const uint path_count = 4u;         // or 8
layout(constant_id = 9) const uint census_words = 1u;       // 2 only where costs are stored
layout(constant_id = 10) const uint adaptive = 0u;          // nonzero: p2 falls with the gradient of the left image

const uint disparities = max_disparity;  // at most path_lanes * lane_disparities
const uint block_pixels = block_width * block_height;
const uint lane_pairs = lane_disparities / 2u;
const uint lane_words = lane_disparities * sum_bytes / 4u;
const uint padded_disparities = path_lanes * lane_disparities;
const bool stored_costs = stored != 0u;

layout(buffer_reference, scalar, buffer_reference_align = 8) buffer Uvec2Array { uvec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Uvec4Array { uvec4 at[]; };

uint lane() { return gl_SubgroupInvocationID % path_lanes; }
uint cluster() { return gl_SubgroupID * (subgroup_lanes / path_lanes) + gl_SubgroupInvocationID / path_lanes; }
uint cluster_count() { return gl_WorkGroupSize.x / path_lanes; }

// to[first ...] = the `count` words of item `index`, by the widest loads that fit; `count` is a constant.
#define LOAD_WORDS(to, first, count, words, index)                                 \
  if ((count) % 4u == 0u) {                                                        \
    [[unroll]] for (uint i_ = 0u; i_ < (count) / 4u; ++i_) {                       \
      uvec4 v_ = Uvec4Array(words).at[(index) * ((count) / 4u) + i_];              \
      to[(first) + 4u * i_] = v_.x, to[(first) + 4u * i_ + 1u] = v_.y;             \
      to[(first) + 4u * i_ + 2u] = v_.z, to[(first) + 4u * i_ + 3u] = v_.w;        \
    }                                                                              \
  } else if ((count) % 2u == 0u) {                                                 \
    [[unroll]] for (uint i_ = 0u; i_ < (count) / 2u; ++i_) {                       \
      uvec2 v_ = Uvec2Array(words).at[(index) * ((count) / 2u) + i_];              \
      to[(first) + 2u * i_] = v_.x, to[(first) + 2u * i_ + 1u] = v_.y;             \
    }                                                                              \
  } else {                                                                         \
    [[unroll]] for (uint i_ = 0u; i_ < (count); ++i_) to[(first) + i_] = (words).at[(index) * (count) + i_]; \
  }

/// Hamming distances of one left word to two right ones, as a pair.
uint hamming_pair(uint left, uint right_low, uint right_high) {
  return uint(bitCount(left ^ right_low)) | uint(bitCount(left ^ right_high)) << 16;
}
#endif
