// SPDX-License-Identifier: Apache-2.0
// Along a column or a diagonal with costs from census words, or along any line with stored costs: what a pixel needs is loaded some pixels
// ahead.
#ifndef SIMSENSE_WALK_LINES_GLSL
#define SIMSENSE_WALK_LINES_GLSL
#include "lib/walk.glsl"

const uint needed_words = stored_costs ? lane_pairs : lane_disparities;
const uint ahead = needed_words > 8u ? 2u : steps;  // pixels; many registers cost more than the wait

uint needed[ahead * needed_words];
uint left_ahead[ahead], gray_ahead[ahead];

/// The lane's right words of a pixel start at any column; one of the four shifted copies has them aligned.
void fetch_census(Path p, uint t, uint from_block, uint slot) {
  uint position = t - p.start, y = p.backward ? p.pixels - 1u - position : position, x = diagonal ? diagonal_column(p, int(from_block)) : p.line;
  uint row = gl_WorkGroupID.z * push.height + y, shift = (3u - x) & 3u;
  left_ahead[slot] = push.left_census.at[row * push.width + x + left_margin];
  uint word = shift * push.right_copy_words + row * push.right_pitch + push.right_origin + shift + x + 1u - (lane() + 1u) * lane_disparities;
  [[unroll]] for (uint i = 0u; i < lane_disparities; i += 4u) {
    uvec4 words = Uvec4Array(push.right_census).at[(word + i) / 4u];
    [[unroll]] for (uint c = 0u; c < 4u; ++c) needed[slot * lane_disparities + i + c] = words[c];
  }
}

/// t: `from_block` times after the first of the block.
void fetch(Path p, uint t, uint from_block, uint slot) {
  t = time_on_line(p, t);
  if (adaptive != 0u) gray_ahead[slot] = push.gray.at[path_pixel(p, t, from_block) + left_margin];
  if (stored_costs) {
    LOAD_WORDS(needed, slot * lane_pairs, lane_pairs, push.cost, lane_item(p, path_pixel(p, t, from_block)))
  } else {
    fetch_census(p, t, from_block, slot);
  }
}

uint pair_cost(Path p, uint slot, uint k) {
  if (stored_costs) {
    uint mirror = needed[slot * lane_pairs + lane_pairs - 1u - k];
    return p.mirrored ? mirror << 16 | mirror >> 16 : needed[slot * lane_pairs + k];
  }
  uint last = slot * lane_disparities + lane_disparities - 1u;
  return hamming_pair(left_ahead[slot], needed[last - k], needed[last - k - lane_pairs]);
}

void walk_line_part(UintArray sums, Path p, uint begin, uint end, bool after_middle) {
  [[dont_unroll]] for (uint t = begin; t < end; t += steps) {
    begin_block(sums, p, t, after_middle);
    [[unroll]] for (uint s = 0u; s < steps; ++s) {
      [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) step_cost[k] = pair_cost(p, s % ahead, k);
      if (adaptive != 0u) heed_gradient(gray_ahead[s % ahead]);
      fetch(p, t + s + ahead, s + ahead, s % ahead);
      visit(sums, p, t + s, s, after_middle);
    }
    end_block(p, after_middle);
  }
}

void walk_lines(UintArray sums, Path p) {
  if (!stored_costs) p.mirrored = false;  // a constant: only rows are
  begin_columns(p);
  [[unroll]] for (uint s = 0u; s < ahead; ++s) fetch(p, s, s, s);
  begin_sums(sums, p);
  walk_line_part(sums, p, 0u, p.middle, false);
  meet(sums, p);
  walk_line_part(sums, p, p.middle, p.end, true);
}
#endif
