// A path's way through the image, and the sum it leaves with its opposite. Two opposite paths of a line walk at the same time and meet in
// the middle: up to there each stores its own costs, beyond it each adds to what the other has left, so that one volume holds their sum. A
// path starts at time `start`, chosen so that they meet between two blocks of `steps` times; where the line's length is odd, the backward
// path is one late. Loops and branches around subgroup operations are the same for a whole workgroup: a shuffle in code that may diverge is
// several times as long on NVIDIA.
#ifndef SIMSENSE_WALK_GLSL
#define SIMSENSE_WALK_GLSL
#include "lib/path_state.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer SumArray { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) coherent buffer SumVec2Array { uvec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) coherent buffer SumVec4Array { uvec4 at[]; };

struct Path {
  uint pixels;       // along the path
  uint line;         // row or column
  uint first;        // pixel at time 0, which may lie before the line
  int stride;        // pixels from one to the next
  uint start;        // time of the first pixel
  uint middle, end;  // times, the same for both paths of all lines
  uint kept;         // pixels to store: all, or none of a path that only fills up its workgroup
  bool mirrored;     // lanes and registers hold the disparities in reverse order
  bool backward;
};

uint met[steps * lane_words];  // what the opposite path has left at the pixels ahead

uint time_on_line(Path p, uint t) { return clamp(t, p.start, p.start + p.pixels - 1u); }
uint path_pixel(Path p, uint t) { return uint(int(p.first) + int(t) * p.stride); }
uint lane_item(Path p, uint t) { return path_pixel(p, t) * path_lanes + (p.mirrored ? path_lanes - 1u - lane() : lane()); }

/// The time is after the middle.
void look_ahead(UintArray sums, Path p, uint t, uint slot) {
  uint item = lane_item(p, min(t, p.start + p.pixels - 1u));
  if (lane_words % 4u == 0u) {
    [[unroll]] for (uint i = 0u; i < lane_words / 4u; ++i) {
      uvec4 v = SumVec4Array(sums).at[item * (lane_words / 4u) + i];
      [[unroll]] for (uint c = 0u; c < 4u; ++c) met[slot * lane_words + 4u * i + c] = v[c];
    }
  } else if (lane_words % 2u == 0u) {
    [[unroll]] for (uint i = 0u; i < lane_words / 2u; ++i) {
      uvec2 v = SumVec2Array(sums).at[item * (lane_words / 2u) + i];
      met[slot * lane_words + 2u * i] = v.x, met[slot * lane_words + 2u * i + 1u] = v.y;
    }
  } else {
    [[unroll]] for (uint w = 0u; w < lane_words; ++w) met[slot * lane_words + w] = SumArray(sums).at[item * lane_words + w];
  }
}

uint mirror_elements(uint word) {
  if (sum_bytes == 4u) return word;
  word = word << 16 | word >> 16;
  return sum_bytes == 2u ? word : (word << 8 & 0xff00ff00u) | (word >> 8 & 0x00ff00ffu);
}

/// Word w of what the path leaves at a pixel: its own costs, after the middle the sum of both.
uint kept_word(Path p, uint slot, bool after_middle, uint w) {
  uint own = p.mirrored ? mirror_elements(path_word(lane_words - 1u - w)) : path_word(w);
  return after_middle ? own + met[slot * lane_words + w] : own;
}

void leave(UintArray sums, Path p, uint t, uint slot, bool after_middle) {
  if (t - p.start >= p.kept) return;
  uint item = lane_item(p, t);
  if (lane_words % 4u == 0u) {
    [[unroll]] for (uint i = 0u; i < lane_words / 4u; ++i)
      SumVec4Array(sums).at[item * (lane_words / 4u) + i] = uvec4(kept_word(p, slot, after_middle, 4u * i), kept_word(p, slot, after_middle, 4u * i + 1u),
                                                                   kept_word(p, slot, after_middle, 4u * i + 2u), kept_word(p, slot, after_middle, 4u * i + 3u));
  } else if (lane_words % 2u == 0u) {
    [[unroll]] for (uint i = 0u; i < lane_words / 2u; ++i)
      SumVec2Array(sums).at[item * (lane_words / 2u) + i] = uvec2(kept_word(p, slot, after_middle, 2u * i), kept_word(p, slot, after_middle, 2u * i + 1u));
  } else {
    [[unroll]] for (uint w = 0u; w < lane_words; ++w) SumArray(sums).at[item * lane_words + w] = kept_word(p, slot, after_middle, w);
  }
}

/// Between the two halves of the way.
void meet(UintArray sums, Path p) {
  memoryBarrierBuffer();
  barrier();
  [[unroll]] for (uint s = 0u; s < steps; ++s) look_ahead(sums, p, p.middle + s, s);
}

/// One pixel, whose cost is in step_cost; slot = t % steps. after_middle is a constant: a loop of its own for each half keeps the loads ahead
/// free of conditions, which would make them wait for memory.
void visit(UintArray sums, Path p, uint t, uint slot, bool after_middle) {
  // A cost of 0 before the start leaves the path's initial state as it is.
  if (!after_middle) {
    uint mask = t < p.start ? 0u : 0xffffffffu;
    [[unroll]] for (uint k = 0u; k < lane_pairs; ++k) step_cost[k] &= mask;
  }
  step_path();
  leave(sums, p, t, slot, after_middle);
  if (after_middle) look_ahead(sums, p, t + steps, slot);
}
#endif
