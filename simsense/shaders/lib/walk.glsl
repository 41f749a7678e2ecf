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
  uint pixels;     // along the path
  uint line;       // row or column
  uint first;      // volume pixel at time 0, which may lie before the line
  int stride;      // pixels from one to the next
  uint start;      // time of the first pixel
  uint middle, end;  // times, the same for both paths of all lines
  bool mirrored;   // lanes and registers hold the disparities in reverse order
  bool backward;
  bool valid;      // else it runs along, and stores nothing
};

uint met[steps * lane_words];  // what the opposite path has left at the pixels ahead

bool on_line(Path p, uint t) { return t - p.start < p.pixels; }
uint time_on_line(Path p, uint t) { return clamp(t, p.start, p.start + p.pixels - 1u); }
uint path_pixel(Path p, uint t) { return uint(int(p.first) + int(t) * p.stride); }
uint lane_item(Path p, uint t) { return path_pixel(p, t) * path_lanes + (p.mirrored ? path_lanes - 1u - lane() : lane()); }

void look_ahead(UintArray sums, Path p, uint t, uint slot) {
  if (!on_line(p, t)) return;
  uint item = lane_item(p, t);
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

uint sum_word(Path p, uint slot, uint w) {
  uint own = p.mirrored ? mirror_elements(path_word(lane_words - 1u - w)) : path_word(w);
  return own + met[slot * lane_words + w];
}

void store_sum(UintArray sums, Path p, uint t, uint slot) {
  if (!p.valid || !on_line(p, t)) return;
  uint item = lane_item(p, t);
  if (lane_words % 4u == 0u) {
    [[unroll]] for (uint i = 0u; i < lane_words / 4u; ++i)
      SumVec4Array(sums).at[item * (lane_words / 4u) + i] = uvec4(sum_word(p, slot, 4u * i), sum_word(p, slot, 4u * i + 1u),
                                                                   sum_word(p, slot, 4u * i + 2u), sum_word(p, slot, 4u * i + 3u));
  } else if (lane_words % 2u == 0u) {
    [[unroll]] for (uint i = 0u; i < lane_words / 2u; ++i)
      SumVec2Array(sums).at[item * (lane_words / 2u) + i] = uvec2(sum_word(p, slot, 2u * i), sum_word(p, slot, 2u * i + 1u));
  } else {
    [[unroll]] for (uint w = 0u; w < lane_words; ++w) SumArray(sums).at[item * lane_words + w] = sum_word(p, slot, w);
  }
}

void forget_met() {
  [[unroll]] for (uint i = 0u; i < steps * lane_words; ++i) met[i] = 0u;
}

/// Before the times t .. t + steps - 1.
void begin_block(UintArray sums, Path p, uint t) {
  if (t != p.middle) return;
  memoryBarrierBuffer();
  barrier();
  [[unroll]] for (uint s = 0u; s < steps; ++s) look_ahead(sums, p, t + s, s);
}

/// One pixel, whose cost is in step_cost; slot = t % steps.
void visit(UintArray sums, Path p, uint t, uint slot) {
  step_path();
  store_sum(sums, p, t, slot);
  if (t >= p.middle) look_ahead(sums, p, t + steps, slot);
}

/// A cost of 0 before the start leaves the path's initial state as it is.
uint cost_mask(Path p, uint t) { return t < p.start ? 0u : 0xffffffffu; }
#endif
