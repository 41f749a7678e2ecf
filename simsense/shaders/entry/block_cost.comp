// Hamming costs summed over a block, for block_pairs pairs of one lane's disparities: an invocation walks down the rows with the sums of its
// column in registers, adding the row that enters the block and taking off the one that leaves; the columns are summed through shared
// memory. Pixels outside the image take the cost of the nearest one inside.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/lanes.glsl"

layout(constant_id = 10) const uint block_width = 7u;
layout(constant_id = 11) const uint block_height = 7u;
layout(constant_id = 12) const uint block_pairs = 4u;       // divides lane_pairs
layout(constant_id = 13) const uint columns = 1u;           // per invocation
layout(constant_id = 14) const uint rows_per_group = 64u;

const uint group_columns = 256u * columns, group_outputs = group_columns - (block_width - 1u);

shared uint column_sums[block_pairs * group_columns];
uint sums[columns * block_pairs];

int clamp_to(int value, uint size) { return clamp(value, 0, int(size) - 1); }

/// Adds (sign 1) or takes off (sign -1) one row of the image; x: of this invocation's first column.
void add_row(int x, int y, uint lane_start, uint sign) {
  uint row = gl_WorkGroupID.z * push.height + uint(clamp_to(y, push.height));
  [[unroll]] for (uint c = 0u; c < columns; ++c) {
    uint column = uint(clamp_to(x + int(256u * c), push.width));
    uint left = push.left_census.at[row * push.width + column];
    uint right = row * push.right_pitch + push.right_origin + column - lane_start;
    [[unroll]] for (uint k = 0u; k < block_pairs; ++k)
      sums[c * block_pairs + k] += sign * hamming_pair(left, push.right_census.at[right - k], push.right_census.at[right - k - lane_pairs]);
  }
}

/// Sums of the block's columns for output column `column`, stored as words first_word .. of its pixel.
void store_blocks(uint column, uint pixel, uint first_word) {
  uint totals[block_pairs];
  [[unroll]] for (uint k = 0u; k < block_pairs; ++k) totals[k] = 0u;
  for (uint i = 0u; i < block_width; ++i)
    [[unroll]] for (uint k = 0u; k < block_pairs; ++k) totals[k] += column_sums[k * group_columns + column + i];
  uint at = pixel * (padded_disparities / 2u) + first_word;
  if (block_pairs % 4u == 0u) {
    [[unroll]] for (uint k = 0u; k < block_pairs; k += 4u)
      Uvec4Array(push.cost).at[(at + k) >> 2] = uvec4(totals[k], totals[k + 1u], totals[k + 2u], totals[k + 3u]);
  } else {
    [[unroll]] for (uint k = 0u; k < block_pairs; ++k) push.cost.at[at + k] = totals[k];
  }
}

void main() {
  uint parts = padded_disparities / 2u / block_pairs, part = gl_WorkGroupID.x % parts;
  uint first_word = part * block_pairs;
  uint lane_start = first_word / lane_pairs * lane_disparities + first_word % lane_pairs;
  int tile_x = int(gl_WorkGroupID.x / parts * group_outputs), x = tile_x - int(block_width / 2u) + int(gl_LocalInvocationID.x);
  int first_row = int(gl_WorkGroupID.y * rows_per_group), end_row = min(first_row + int(rows_per_group), int(push.height));
  int reach = int(block_height / 2u);
  [[unroll]] for (uint i = 0u; i < columns * block_pairs; ++i) sums[i] = 0u;
  for (int y = first_row - reach; y <= first_row + reach; ++y) add_row(x, y, lane_start, 1u);
  for (int y = first_row; y < end_row; ++y) {
    [[unroll]] for (uint i = 0u; i < columns * block_pairs; ++i)
      column_sums[i % block_pairs * group_columns + gl_LocalInvocationID.x + 256u * (i / block_pairs)] = sums[i];
    barrier();
    for (uint column = gl_LocalInvocationID.x; column < group_outputs; column += 256u) {
      uint out_x = uint(tile_x) + column;
      if (out_x < push.width) store_blocks(column, (gl_WorkGroupID.z * push.height + uint(y)) * push.width + out_x, first_word);
    }
    barrier();
    add_row(x, y + reach + 1, lane_start, 1u);
    add_row(x, y - reach, lane_start, 0xffffffffu);
  }
}
