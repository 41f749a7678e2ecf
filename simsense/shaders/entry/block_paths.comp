// SPDX-License-Identifier: Apache-2.0
// Paths whose costs are block sums that no memory holds. A workgroup follows neighbouring lines, both ways: at each step a path's block takes
// in one line of pixels across and leaves another, so every cluster works out the change of its own line alone, and adds up its
// neighbours' through shared memory. The lines at the workgroup's edges only do that for the others.
// Compiled twice: with HALF_MIN minima are packed half floats, where the device has them and the costs' range fits; else integers.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/walk.glsl"

const bool along_rows = part == PATHS_ROWS;
const uint across = along_rows ? block_height : block_width, along = along_rows ? block_width : block_height;
const uint change_bias = 32u;  // keeps changes positive: a census word has at most 32 bits
const uint ahead = lane_disparities > 8u ? 1u : 2u;

layout(constant_id = 13) const uint group_words = 256u;  // a workgroup's lanes times lane_pairs
shared uint changes[2u * group_words];

uint entering[ahead * lane_disparities], leaving[ahead * lane_disparities];  // right words
uint left_entering[ahead], left_leaving[ahead], gray_ahead[ahead];
uint block_costs[lane_pairs];

/// The pixel at a path's position, the nearest one of the line where there is none.
uvec2 pixel_at(Path p, int position) {
  uint place = uint(clamp(position, 0, int(p.pixels) - 1));
  if (p.backward) place = p.pixels - 1u - place;
  return along_rows ? uvec2(place, p.line) : uvec2(p.line, place);
}

/// As in walk_lines.glsl: one of the four shifted copies has the lane's words aligned.
uint first_right_word(uvec2 pixel) {
  uint shift = (3u - pixel.x) & 3u, row = gl_WorkGroupID.z * push.height + pixel.y;
  return shift * push.right_copy_words + row * push.right_pitch + push.right_origin + shift + pixel.x + 1u -
         (lane() + 1u) * lane_disparities;
}

uint left_word(uvec2 pixel) {
  return push.left_census.at[(gl_WorkGroupID.z * push.height + pixel.y) * push.width + pixel.x + left_margin];
}

/// What enters and what leaves the block at this time.
void fetch(Path p, uint t, uint slot) {
  int position = int(t) - int(p.start), reach = int(along / 2u);
  uvec2 in_pixel = pixel_at(p, position + reach), out_pixel = pixel_at(p, position - reach - 1);
  left_entering[slot] = left_word(in_pixel);
  left_leaving[slot] = left_word(out_pixel);
  uint in_word = first_right_word(in_pixel), out_word = first_right_word(out_pixel);
  [[unroll]] for (uint i = 0u; i < lane_disparities; i += 4u) {
    uvec4 in_words = Uvec4Array(push.right_census).at[(in_word + i) >> 2], out_words = Uvec4Array(push.right_census).at[(out_word + i) >> 2];
    [[unroll]] for (uint c = 0u; c < 4u; ++c)
      entering[slot * lane_disparities + i + c] = in_words[c], leaving[slot * lane_disparities + i + c] = out_words[c];
  }
  if (adaptive != 0u) gray_ahead[slot] = push.gray.at[path_pixel(p, time_on_line(p, t), 0u) + left_margin];
}

/// Adds the changes of the lines that the block covers; `turn` alternates between 0 and 1, so that one barrier suffices.
void exchange(uint turn, uint own[lane_pairs]) {
  uint first = turn * group_words, lines = cluster_count() / 2u, line = cluster() % lines, direction = cluster() - line;
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) changes[first + (cluster() * lane_pairs + k) * path_lanes + lane()] = own[k];
  barrier();
  for (uint i = 0u; i < across; ++i) {
    uint from = direction + uint(clamp(int(line + i) - int(across / 2u), 0, int(lines) - 1));
    [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) block_costs[k] += changes[first + (from * lane_pairs + k) * path_lanes + lane()];
  }
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) block_costs[k] -= both(across * change_bias);
}

/// Block costs of the first pixel: all lines of its block enter one by one.
void fill_block(Path p) {
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) block_costs[k] = 0u;
  for (uint i = 0u; i < along; ++i) {
    uvec2 pixel = pixel_at(p, int(i) - int(along / 2u));
    uint left = left_word(pixel), word = first_right_word(pixel), own[lane_pairs];
    [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
      uint last = word + lane_disparities - 1u - k;
      own[k] = hamming_pair(left, push.right_census.at[last], push.right_census.at[last - lane_pairs]) + both(change_bias);
    }
    exchange(i & 1u, own);
  }
  barrier();
}

void step_block(Path p, uint t, uint slot, uint turn) {
  uint own[lane_pairs], last = slot * lane_disparities + lane_disparities - 1u;
  bool moves = int(t) > int(p.start);  // before, the block stands at the first pixel
  [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) {
    uint comes = hamming_pair(left_entering[slot], entering[last - k], entering[last - k - lane_pairs]);
    uint goes = hamming_pair(left_leaving[slot], leaving[last - k], leaving[last - k - lane_pairs]);
    own[k] = both(change_bias) + (moves ? comes - goes : 0u);
  }
  exchange(turn, own);
}

void walk_part(UintArray sums, Path p, uint begin, uint end, bool after_middle) {
  [[dont_unroll]] for (uint t = begin; t < end; t += steps) {
    begin_block(sums, p, t, after_middle);
    [[unroll]] for (uint s = 0u; s < steps; ++s) {
      step_block(p, t + s, s % ahead, s & 1u);
      [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) step_cost[k] = block_costs[k];
      if (adaptive != 0u) heed_gradient(gray_ahead[s % ahead]);
      fetch(p, t + s + ahead, s % ahead);
      visit(sums, p, t + s, s, after_middle);
    }
    end_block(p, after_middle);
  }
}

Path make_path() {
  uint lines = cluster_count() / 2u, outputs = lines - (across - 1u), local_line = cluster() % lines, count = along_rows ? push.height : push.width;
  int line = int(gl_WorkGroupID.x * outputs + local_line) - int(across / 2u);
  bool keeps = local_line >= across / 2u && local_line < across / 2u + outputs && line < int(count);
  Path p;
  p.pixels = along_rows ? push.width : push.height;
  p.kept = keeps ? p.pixels : 0u;
  p.line = uint(clamp(line, 0, int(count) - 1));
  p.backward = cluster() >= lines;
  p.mirrored = false;
  p.drift = 0;
  set_times(p, along_rows);
  return p;
}

void main() {
  Path p = make_path();
  begin_path(false);
  gray_before = 0u;
  fill_block(p);
  [[unroll]] for (uint s = 0u; s < ahead; ++s) fetch(p, s, s);
  begin_sums(push.first_sums, p);
  walk_part(push.first_sums, p, 0u, p.middle, false);
  meet(push.first_sums, p);
  walk_part(push.first_sums, p, p.middle, p.end, true);
}
