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

layout(constant_id = 14) const uint part = 0u;  // paths of this dispatch: 0 rows and columns, 1 diagonals, 2 rows, 3 columns
const bool diagonal = part == 1u;
const bool adds = part == 1u || part == 3u;  // to what the paths of an earlier dispatch have left

struct Path {
  uint pixels;       // along the path
  uint line;         // row or column; of a diagonal, the column where it crosses row 0
  uint first;        // pixel at time 0, which may lie before the line
  int stride;        // pixels from one to the next
  uint start;        // time of the first pixel
  uint middle, end;  // times, the same for both paths of all lines
  uint kept;         // pixels to store: all, or none of a path that only fills up its workgroup
  bool mirrored;     // lanes and registers hold the disparities in reverse order
  bool backward;
  bool leftward;     // of a diagonal: down and to the left, as seen from above
};

/// Sets what follows from the line, its pixels and the direction.
void set_times(inout Path p, bool horizontal) {
  uint half_line = (p.pixels + 1u) / 2u, odd = p.pixels & 1u;
  p.stride = (horizontal ? 1 : int(push.width)) * (p.backward ? -1 : 1);
  p.middle = (half_line + steps - 1u) / steps * steps;
  p.start = p.middle - half_line + (p.backward ? odd : 0u);
  p.end = p.middle - half_line + odd + p.pixels;
  p.first = gl_WorkGroupID.z * push.width * push.height + p.line * (horizontal ? push.width : 1u);
  if (p.backward) p.first += (p.pixels - 1u) * (horizontal ? 1u : push.width);
  p.first -= uint(int(p.start) * p.stride);
}

uint met[steps * lane_words];  // what the opposite path has left at the pixels ahead

uint time_on_line(Path p, uint t) { return clamp(t, p.start, p.start + p.pixels - 1u); }

/// Diagonals leave the image at one side and enter it at the other, as a new path: all are as long as the columns, and lie side by side.
uvec2 diagonal_pixel(Path p, uint t) {
  uint position = t - p.start, y = p.backward ? p.pixels - 1u - position : position;
  return uvec2((p.line + (p.leftward ? push.width - y % push.width : y)) % push.width, y);
}

uint path_pixel(Path p, uint t) {
  if (!diagonal) return uint(int(p.first) + int(t) * p.stride);
  uvec2 pixel = diagonal_pixel(p, t);
  return (gl_WorkGroupID.z * push.height + pixel.y) * push.width + pixel.x;
}

/// Whether a diagonal path enters the image at this time.
bool enters(Path p, uint t) { return diagonal_pixel(p, t).x == (p.leftward != p.backward ? push.width - 1u : 0u); }

uint gray_before;

/// SGM's P2 between the pixel before and this one (Hirschmüller 2008): less across edges of the left image, but at least P1.
void heed_gradient(uint gray) {
  uint gradient = uint(abs(int(gray) - int(gray_before)));
  uint penalty = gradient <= push.p2_full_gradient ? push.p2 / block_pixels : push.p2 / block_pixels * push.p2_full_gradient / gradient;
  jump_penalty = max(push.p1, penalty * block_pixels);
  gray_before = gray;
}
uint lane_item(Path p, uint t) { return path_pixel(p, t) * path_lanes + (p.mirrored ? path_lanes - 1u - lane() : lane()); }

void look_ahead(UintArray sums, Path p, uint t, uint slot) {
  uint item = lane_item(p, time_on_line(p, t));
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

/// Word w of what the path leaves at a pixel: its own costs, and what others have left there after the middle or, where the dispatch adds, ever.
uint kept_word(Path p, uint slot, bool after_middle, uint w) {
  uint own = p.mirrored ? mirror_elements(path_word(lane_words - 1u - w)) : path_word(w);
  return after_middle || adds ? own + met[slot * lane_words + w] : own;
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

/// Before the first step.
void begin_sums(UintArray sums, Path p) {
  if (!adds) return;
  [[unroll]] for (uint s = 0u; s < steps; ++s) look_ahead(sums, p, s, s);
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
  if (diagonal) restart_path(enters(p, t));
  step_path();
  leave(sums, p, t, slot, after_middle);
  if (after_middle || adds) look_ahead(sums, p, t + steps, slot);
}
#endif
