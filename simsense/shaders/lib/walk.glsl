// SPDX-License-Identifier: Apache-2.0
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

layout(constant_id = 11) const uint part = PATHS_ROWS_AND_COLUMNS;  // PATHS_*: those of this dispatch
layout(constant_id = 12) const uint adds_paths = 0u;  // nonzero: adds to what the paths of an earlier dispatch have left
const bool diagonal = part == PATHS_DIAGONALS;
const bool adds = adds_paths != 0u;

struct Path {
  uint pixels;       // along the path
  uint line;         // row or column; of a diagonal, the column where it crosses row 0
  uint first;        // pixel at time 0, which may lie before the line; of a diagonal, the first of its row
  int stride;        // pixels from one to the next; of a diagonal, from row to row
  int drift;         // of a diagonal: columns from one pixel to the next, 1 or -1
  uint start;        // time of the first pixel
  uint middle, end;  // times, the same for both paths of all lines
  uint kept;         // pixels to store: all, or none of a path that only fills up its workgroup
  bool mirrored;     // lanes and registers hold the disparities in reverse order
  bool backward;
};

/// Sets what follows from the line, its pixels and the direction.
void set_times(inout Path p, bool horizontal) {
  uint half_line = (p.pixels + 1u) / 2u, odd = p.pixels & 1u;
  p.stride = (horizontal ? 1 : int(push.width)) * (p.backward ? -1 : 1);
  p.middle = (half_line + steps - 1u) / steps * steps;
  p.start = p.middle - half_line + (p.backward ? odd : 0u);
  p.end = p.middle - half_line + odd + p.pixels;
  p.first = gl_WorkGroupID.z * push.width * push.height + (diagonal ? 0u : p.line * (horizontal ? push.width : 1u));
  if (p.backward) p.first += (p.pixels - 1u) * (horizontal ? 1u : push.width);
  p.first -= uint(int(p.start) * p.stride);
}

uint block_column;  // of a diagonal, at the first time of the block of steps at hand

/// Diagonals leave the image at one side and enter it at the other, as a new path: all are as long as the columns, and lie side by side.
/// The column is less than a width away from the image.
uint wrapped(int column) {
  column += column < 0 ? int(push.width) : 0;
  return uint(column - (column >= int(push.width) ? int(push.width) : 0));
}

/// `ahead` times after the first of the block.
uint diagonal_column(Path p, int ahead) { return wrapped(int(block_column) + ahead * p.drift); }

void begin_columns(Path p) {
  if (!diagonal) return;
  uint row = p.backward ? p.pixels - 1u : 0u, reach = row % push.width;
  bool leftward = (p.drift < 0) != p.backward;  // as seen from above
  block_column = wrapped(int(wrapped(int(p.line + (leftward ? push.width - reach : reach)))) - int(p.start) * p.drift);
}

uint time_on_line(Path p, uint t) { return clamp(t, p.start, p.start + p.pixels - 1u); }

/// Pixel at time t, which lies `ahead` after the first of the block.
uint path_pixel(Path p, uint t, uint ahead) { return uint(int(p.first) + int(t) * p.stride) + (diagonal ? diagonal_column(p, int(ahead)) : 0u); }

/// Whether a diagonal path enters the image at this column.
bool enters(Path p, uint column) { return column == (p.drift < 0 ? push.width - 1u : 0u); }

uint gray_before;

/// SGM's P2 between the pixel before and this one (Hirschmüller 2008): less across edges of the left image, but at least P1.
void heed_gradient(uint gray) {
  uint gradient = uint(abs(int(gray) - int(gray_before)));
  uint penalty = gradient <= push.p2_full_gradient_dn ? push.p2 / block_pixels : push.p2 / block_pixels * push.p2_full_gradient_dn / gradient;
  jump_penalty = max(push.p1, penalty * block_pixels);
  gray_before = gray;
}

uint lane_item(Path p, uint pixel) { return pixel * path_lanes + (p.mirrored ? path_lanes - 1u - lane() : lane()); }

const uint block_words = steps * lane_words;
uint met[block_words], next_met[block_words];  // what others have left at the pixels of this block and of the next one

/// All pixels of a block at once: a load at every step would have the step's shuffles wait for it.
void look_ahead(UintArray sums, Path p, uint t, uint ahead) {
  [[unroll]] for (uint s = 0u; s < steps; ++s) {
    uint item = lane_item(p, path_pixel(p, time_on_line(p, t + s), ahead + s)), slot = s * lane_words;
    if (lane_words % 4u == 0u) {
      [[unroll]] for (uint i = 0u; i < lane_words / 4u; ++i) {
        uvec4 v = SumVec4Array(sums).at[item * (lane_words / 4u) + i];
        [[unroll]] for (uint c = 0u; c < 4u; ++c) next_met[slot + 4u * i + c] = v[c];
      }
    } else if (lane_words % 2u == 0u) {
      [[unroll]] for (uint i = 0u; i < lane_words / 2u; ++i) {
        uvec2 v = SumVec2Array(sums).at[item * (lane_words / 2u) + i];
        next_met[slot + 2u * i] = v.x, next_met[slot + 2u * i + 1u] = v.y;
      }
    } else {
      [[unroll]] for (uint w = 0u; w < lane_words; ++w) next_met[slot + w] = SumArray(sums).at[item * lane_words + w];
    }
  }
}

void take_met() {
  [[unroll]] for (uint i = 0u; i < block_words; ++i) met[i] = next_met[i];
}

/// Word w of what the path leaves at a pixel: its own costs, and what others have left there after the middle or, where the dispatch adds, ever.
uint kept_word(Path p, uint slot, bool after_middle, uint w) {
  uint own = p.mirrored ? mirrored_word(lane_words - 1u - w) : path_word(w);
  return after_middle || adds ? own + met[slot * lane_words + w] : own;
}

void leave(UintArray sums, Path p, uint t, uint slot, bool after_middle) {
  if (t - p.start >= p.kept) return;
  uint item = lane_item(p, path_pixel(p, t, slot));
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
  look_ahead(sums, p, 0u, 0u);
  take_met();
}

/// Between the two halves of the way.
void meet(UintArray sums, Path p) {
  memoryBarrierBuffer();
  barrier();
  look_ahead(sums, p, p.middle, 0u);
  take_met();
}

/// Before and after the steps of a block that begins at time t. after_middle is a constant: a loop of its own for each half keeps the loads
/// ahead free of conditions, which would make them wait for memory.
void begin_block(UintArray sums, Path p, uint t, bool after_middle) {
  if (after_middle || adds) look_ahead(sums, p, t + steps, steps);
}

void end_block(Path p, bool after_middle) {
  if (after_middle || adds) take_met();
  if (diagonal) block_column = diagonal_column(p, int(steps));
}

/// One pixel, whose cost is in step_cost; slot = t % steps. Up to its start a path begins again at every time.
void visit(UintArray sums, Path p, uint t, uint slot, bool after_middle) {
  bool begins = !after_middle && t <= p.start;
  if (diagonal) begins = begins || enters(p, diagonal_column(p, int(slot)));
  step_path(begins);
  leave(sums, p, t, slot, after_middle);
}
#endif
