// SPDX-License-Identifier: Apache-2.0
// Hamming costs summed over a block. An invocation holds four neighbouring columns of one part, four pairs of a lane's disparities: it walks
// down the rows with the columns' sums in registers, adding the row that enters the block and taking off the one that leaves; the columns
// are summed through shared memory. Pixels outside the image take the cost of the nearest one inside.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/lanes.glsl"

layout(push_constant, scalar) uniform Push { PathPush push; };
layout(constant_id = 11) const uint group_parts = 16u;      // power of two, divides the parts of a pixel
layout(constant_id = 12) const uint rows_per_group = 64u;

const uint part_pairs = 4u, thread_columns = 4u;
const uint parts = padded_disparities / (2u * part_pairs);
const uint group_columns = 256u / group_parts * thread_columns, group_outputs = group_columns - (block_width - 1u);

shared uvec4 column_sums[group_columns * group_parts];
uvec4 sums[thread_columns];

int clamp_to(int value, uint size) { return clamp(value, 0, int(size) - 1); }

uvec4 pair_costs(uint row, uint column, uint lane_start) {
  uint left = row * push.width + column + left_margin;
  uint right = row * push.right_pitch + push.right_origin + column - lane_start;
  uvec4 costs = uvec4(0u);
  [[unroll]] for (uint word = 0u; word < census_words; ++word)
    [[unroll]] for (uint k = 0u; k < part_pairs; ++k)
      costs[k] += hamming_pair(push.left_census.at[left * census_words + word], push.right_census.at[(right - k) * census_words + word],
                               push.right_census.at[(right - k - lane_pairs) * census_words + word]);
  return costs;
}

/// Adds (sign 1) or takes off (sign -1) one row of the image; x: first of this invocation's columns.
void add_row(int x, int y, uint lane_start, uint sign) {
  uint row = gl_WorkGroupID.z * push.height + uint(clamp_to(y, push.height));
  [[unroll]] for (uint c = 0u; c < thread_columns; ++c)
    sums[c] += sign * pair_costs(row, uint(clamp_to(x + int(c), push.width)), lane_start);
}

/// Blocks of the four output columns from `column` on.
void store_blocks(uint column, uint group_part, uint first_pixel, uint part, uint valid_columns) {
  uvec4 total = uvec4(0u);
  for (uint i = 0u; i < block_width; ++i) total += column_sums[(column + i) * group_parts + group_part];
  for (uint c = 0u; c < min(thread_columns, valid_columns); ++c) {
    Uvec4Array(push.cost).at[(first_pixel + c) * parts + part] = total;
    if (column + c + block_width < group_columns)
      total += column_sums[(column + c + block_width) * group_parts + group_part] - column_sums[(column + c) * group_parts + group_part];
  }
}

void main() {
  uint group_part = gl_LocalInvocationID.x % group_parts, column = gl_LocalInvocationID.x / group_parts * thread_columns;
  uint part = gl_WorkGroupID.x % (parts / group_parts) * group_parts + group_part;
  uint first_pair = part * part_pairs, lane_start = first_pair / lane_pairs * lane_disparities + first_pair % lane_pairs;
  uint tile_x = gl_WorkGroupID.x / (parts / group_parts) * group_outputs;
  int x = int(tile_x + column) - int(block_width / 2u), reach = int(block_height / 2u);
  int first_row = int(gl_WorkGroupID.y * rows_per_group), end_row = min(first_row + int(rows_per_group), int(push.height));
  uint out_x = tile_x + column, end_x = min(tile_x + group_outputs, push.width), valid_columns = out_x < end_x ? end_x - out_x : 0u;
  [[unroll]] for (uint c = 0u; c < thread_columns; ++c) sums[c] = uvec4(0u);
  for (int y = first_row - reach; y <= first_row + reach; ++y) add_row(x, y, lane_start, 1u);
  for (int y = first_row; y < end_row; ++y) {
    [[unroll]] for (uint c = 0u; c < thread_columns; ++c) column_sums[(column + c) * group_parts + group_part] = sums[c];
    barrier();
    store_blocks(column, group_part, (gl_WorkGroupID.z * push.height + uint(y)) * push.width + out_x, part, valid_columns);
    barrier();
    add_row(x, y + reach + 1, lane_start, 1u);
    add_row(x, y - reach, lane_start, 0xffffffffu);
  }
}
