// SPDX-License-Identifier: Apache-2.0
// Along a row with costs from census words: the right image's words that the lane's disparities need move one place per pixel, so they stay
// in registers and four new ones come with each load. The path from the right end sees a mirrored row and runs through the same code.
#ifndef SIMSENSE_WALK_ROWS_GLSL
#define SIMSENSE_WALK_ROWS_GLSL
#include "lib/walk.glsl"

uint window[lane_disparities + steps];  // [lane_disparities + s - k]: right word of the s-th pixel ahead at the lane's disparity k
uint left_words[steps], next_left[steps], next_right[steps];
uint gray_values[steps], next_gray[steps];

/// Group of four right words at position 0 of the lane's window, at time 0, in the plain or the mirrored row.
uint first_group(Path p) {
  uint row = gl_WorkGroupID.z * push.height + p.line, lane_start = lane() * lane_disparities;
  uint shift = (p.mirrored ? 3u - push.width - p.start : p.start) & 3u;  // the copy in which the groups are aligned
  uint origin = shift * push.right_copy_words + row * push.right_pitch + push.right_origin + shift;
  if (!p.mirrored) return (origin - p.start - lane_start - lane_disparities) / 4u;
  return (origin + p.start + push.width - padded_disparities + lane_start + lane_disparities - 3u) / 4u;
}

uvec4 right_group(Path p, uint first, uint position) {
  uint group = p.mirrored ? first - position / 4u : first + position / 4u;
  uvec4 words = Uvec4Array(push.right_census).at[group];
  return p.mirrored ? words.wzyx : words;
}

uint left_word(Path p, uint t) { return push.left_census.at[path_pixel(p, t, 0u) + left_margin]; }
uint gray_value(Path p, uint t) { return adaptive != 0u ? push.gray.at[path_pixel(p, t, 0u) + left_margin] : 0u; }

void fill_window(Path p, uint first, uint t) {
  [[unroll]] for (uint i = 0u; i < lane_disparities + steps; i += 4u) {
    uvec4 words = right_group(p, first, t + i);
    [[unroll]] for (uint c = 0u; c < 4u; ++c) window[i + c] = words[c];
  }
  [[unroll]] for (uint s = 0u; s < steps; ++s) left_words[s] = left_word(p, t + s), gray_values[s] = gray_value(p, t + s);
}

void fetch_next(Path p, uint first, uint t) {
  [[unroll]] for (uint i = 0u; i < steps; i += 4u) {
    uvec4 words = right_group(p, first, t + lane_disparities + i);
    [[unroll]] for (uint c = 0u; c < 4u; ++c) next_right[i + c] = words[c];
  }
  [[unroll]] for (uint s = 0u; s < steps; ++s) next_left[s] = left_word(p, t + s), next_gray[s] = gray_value(p, t + s);
}

void move_window() {
  [[unroll]] for (uint i = 0u; i < lane_disparities; ++i) window[i] = window[i + steps];
  [[unroll]] for (uint s = 0u; s < steps; ++s)
    window[lane_disparities + s] = next_right[s], left_words[s] = next_left[s], gray_values[s] = next_gray[s];
}

void walk_row_part(UintArray sums, Path p, uint first, uint begin, uint end, bool after_middle) {
  [[dont_unroll]] for (uint t = begin; t < end; t += steps) {
    begin_block(sums, p, t, after_middle);
    fetch_next(p, first, t + steps);
    [[unroll]] for (uint s = 0u; s < steps; ++s) {
      [[unroll]] for (uint k = 0u; k < lane_pairs; ++k)
        step_cost[k] = hamming_pair(left_words[s], window[lane_disparities + s - k], window[lane_disparities + s - k - lane_pairs]);
      if (adaptive != 0u) heed_gradient(gray_values[s]);
      visit(sums, p, t + s, s, after_middle);
    }
    move_window();
    end_block(p, after_middle);
  }
}

void walk_rows(UintArray sums, Path p) {
  uint first = first_group(p);
  fill_window(p, first, 0u);
  walk_row_part(sums, p, first, 0u, p.middle, false);
  meet(sums, p);
  walk_row_part(sums, p, first, p.middle, p.end, true);
}
#endif
