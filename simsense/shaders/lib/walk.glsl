// A path's way through the image, and the sum it leaves with its opposite. The two opposite paths of a line meet in the middle: up to there
// each stores its own costs, beyond it each adds to what the other has left, so that one volume holds their sum.
#ifndef SIMSENSE_WALK_GLSL
#define SIMSENSE_WALK_GLSL
#include "lib/path_state.glsl"

layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer SumArray { uint at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) coherent buffer SumVec2Array { uvec2 at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) coherent buffer SumVec4Array { uvec4 at[]; };

struct Path {
  uint pixels;     // along the path
  uint line;       // row or column
  uint first;      // volume pixel at the path's start
  int stride;      // pixels from one to the next
  bool mirrored;   // lanes and registers hold the disparities in reverse order
  bool backward;
  bool valid;      // else it runs along, and stores nothing
  uint add_from;   // from this pixel of the path on the opposite one was there first
};

uint met[steps * lane_words];  // what the opposite path has left at the pixels ahead

uint path_pixel(Path p, uint t) { return uint(int(p.first) + int(t) * p.stride); }
uint lane_item(Path p, uint t) { return path_pixel(p, t) * path_lanes + (p.mirrored ? path_lanes - 1u - lane() : lane()); }

void look_ahead(UintArray sums, Path p, uint t, uint slot) {
  [[unroll]] for (uint w = 0u; w < lane_words; ++w) met[slot * lane_words + w] = 0u;
  if (t < p.add_from || t >= p.pixels) return;
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
  if (!p.valid || t >= p.pixels) return;
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

/// One pixel: step_cost is set; `slot` of met is this pixel's.
void visit(UintArray sums, Path p, uint t, uint slot) {
  step_path();
  store_sum(sums, p, t, slot);
  look_ahead(sums, p, t + steps, slot);
}
#endif
