// SPDX-License-Identifier: Apache-2.0
// Hamming costs summed over a block. An invocation holds four neighbouring columns of one part, four pairs of a lane's disparities: it walks
// down the rows with the columns' sums in registers, adding the row that enters the block and taking off the one that leaves; the columns
// are summed through shared memory. Pixels outside the image take the cost of the nearest one inside.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/lanes.glsl"

layout(push_constant, scalar) uniform Push { PathPush push; };
layout(constant_id = 11) const uint group_parts = 16u;  // power of two, divides the parts of a pixel
layout(constant_id = 12) const uint rows_per_group = 64u;
layout(constant_id = 13) const uint group_columns = 64u;
layout(constant_id = 14) const uint halo = 4u;  // columns beside the outputs, a multiple of four; 0 where a workgroup has all there are

const uint part_pairs = 4u, thread_columns = 4u;
const uint parts = padded_disparities / (2u * part_pairs), group_outputs = group_columns - 2u * halo;

shared uvec4 column_sums[group_columns * group_parts];
uvec4 sums[thread_columns];
int first_column;  // of the workgroup; may lie before the image

int clamp_to(int value, uint size) { return clamp(value, 0, int(size) - 1); }

/// Two groups of four right words, the first of which begins at a multiple of four.
void load_window(out uint words[8], uint first, uint word) {
  [[unroll]] for (uint i = 0u; i < 8u; i += 4u) {
    uvec4 four;
    if (census_words == 1u) {
      four = Uvec4Array(push.right_census).at[(first + i) / 4u];
    } else {
      [[unroll]] for (uint c = 0u; c < 4u; ++c) four[c] = push.right_census.at[(first + i + c) * census_words + word];
    }
    [[unroll]] for (uint c = 0u; c < 4u; ++c) words[i + c] = four[c];
  }
}

/// Adds (sign 1) or takes off (sign -1) one row of the image; x: the first of this invocation's columns.
void add_row(int x, int y, uint lane_start, uint sign) {
  if (x < 0 || x >= int(push.width)) return;
  uint row = gl_WorkGroupID.z * push.height + uint(clamp_to(y, push.height)), left = row * push.width + uint(x) + left_margin;
  uint right = row * push.right_pitch + push.right_origin + uint(x) - lane_start - 4u;
  [[unroll]] for (uint word = 0u; word < census_words; ++word) {
    uint low[8], high[8];
    load_window(low, right, word);
    load_window(high, right - lane_pairs, word);
    [[unroll]] for (uint c = 0u; c < thread_columns; ++c) {
      uint own = push.left_census.at[(left + c) * census_words + word];
      [[unroll]] for (uint k = 0u; k < part_pairs; ++k) sums[c][k] += sign * hamming_pair(own, low[c + 4u - k], high[c + 4u - k]);
    }
  }
}

uvec4 column_sum(int x, uint group_part) { return column_sums[uint(clamp_to(x, push.width) - first_column) * group_parts + group_part]; }

/// Blocks of the output columns x .. end - 1, at most four.
void store_blocks(int x, int end, uint group_part, uint first_pixel, uint part) {
  const int reach = int(block_width / 2u);
  if (x >= end) return;
  uvec4 total = uvec4(0u);
  for (int i = -reach; i <= reach; ++i) total += column_sum(x + i, group_part);
  for (int c = x; c < end; ++c) {
    Uvec4Array(push.cost).at[(first_pixel + uint(c)) * parts + part] = total;
    if (c + 1 < end) total += column_sum(c + 1 + reach, group_part) - column_sum(c - reach, group_part);
  }
}

void main() {
  uint group_part = gl_LocalInvocationID.x % group_parts, column = gl_LocalInvocationID.x / group_parts * thread_columns;
  uint part = gl_WorkGroupID.x % (parts / group_parts) * group_parts + group_part;
  uint first_pair = part * part_pairs, lane_start = first_pair / lane_pairs * lane_disparities + first_pair % lane_pairs;
  uint first_output = gl_WorkGroupID.x / (parts / group_parts) * group_outputs;
  first_column = int(first_output) - int(halo);
  int x = first_column + int(column), reach = int(block_height / 2u);
  int out_x = int(first_output + column), end_x = min(out_x + int(thread_columns), int(min(first_output + group_outputs, push.width)));
  int first_row = int(gl_WorkGroupID.y * rows_per_group), end_row = min(first_row + int(rows_per_group), int(push.height));
  [[unroll]] for (uint c = 0u; c < thread_columns; ++c) sums[c] = uvec4(0u);
  for (int y = first_row - reach; y <= first_row + reach; ++y) add_row(x, y, lane_start, 1u);
  for (int y = first_row; y < end_row; ++y) {
    [[unroll]] for (uint c = 0u; c < thread_columns; ++c) column_sums[(column + c) * group_parts + group_part] = sums[c];
    barrier();
    store_blocks(out_x, end_x, group_part, (gl_WorkGroupID.z * push.height + uint(y)) * push.width, part);
    barrier();
    add_row(x, y + reach + 1, lane_start, 1u);
    add_row(x, y - reach, lane_start, 0xffffffffu);
  }
}
