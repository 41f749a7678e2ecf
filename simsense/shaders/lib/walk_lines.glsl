// Along a column with costs from census words, or along any line with stored costs: what a pixel needs is loaded some pixels ahead.
#ifndef SIMSENSE_WALK_LINES_GLSL
#define SIMSENSE_WALK_LINES_GLSL
#include "lib/walk.glsl"

const bool stored_costs = block_pixels > 1u;
const uint needed_words = stored_costs ? lane_pairs : lane_disparities;
const uint ahead = needed_words > 8u ? 2u : steps;  // pixels; many registers cost more than the wait

uint needed[ahead * needed_words];
uint left_ahead[ahead];

/// The lane's right words of a pixel start at any column; one of the four shifted copies has them aligned.
void fetch_census(Path p, uint t, uint slot) {
  uint position = t - p.start, y = p.backward ? p.pixels - 1u - position : position, row = gl_WorkGroupID.z * push.height + y;
  left_ahead[slot] = push.left_census.at[row * push.width + p.line + left_margin];
  uint shift = (3u - p.line) & 3u;
  uint word = shift * push.right_copy_words + row * push.right_pitch + push.right_origin + shift + p.line + 1u - (lane() + 1u) * lane_disparities;
  [[unroll]] for (uint i = 0u; i < lane_disparities; i += 4u) {
    uvec4 words = Uvec4Array(push.right_census).at[(word + i) >> 2];
    [[unroll]] for (uint c = 0u; c < 4u; ++c) needed[slot * lane_disparities + i + c] = words[c];
  }
}

void fetch(Path p, uint t, uint slot) {
  t = time_on_line(p, t);
  if (stored_costs) {
    LOAD_WORDS(needed, slot * lane_pairs, lane_pairs, push.cost, lane_item(p, t))
  } else {
    fetch_census(p, t, slot);
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
    [[unroll]] for (uint s = 0u; s < steps; ++s) {
      [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) step_cost[k] = pair_cost(p, s % ahead, k);
      fetch(p, t + s + ahead, s % ahead);
      visit(sums, p, t + s, s, after_middle);
    }
  }
}

void walk_lines(UintArray sums, Path p) {
  [[unroll]] for (uint s = 0u; s < ahead; ++s) fetch(p, s, s);
  walk_line_part(sums, p, 0u, p.middle, false);
  meet(sums, p);
  walk_line_part(sums, p, p.middle, p.end, true);
}
#endif
