// SPDX-License-Identifier: Apache-2.0
// Second pass of the refinement (match/refine.h): pixels move by their cells' steps, and windows about them find the rest. A workgroup has
// the pixels of a cell; the evidence of these and of those around stands in shared memory, and then its sums along rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/evidence.glsl"

layout(local_size_x = REFINE_CELL, local_size_y = REFINE_CELL) in;

const uint reach = uint(REFINE_REACH), side = 2u * reach + 1u, tile = cell_side + 2u * reach, invocations = cell_side * cell_side;
const uint near = 5u;  // cells that a workgroup sees along a side
shared int slopes[tile * tile];       // match slope << 16 | slope
shared int differences[tile * tile];  // difference << 1 | counts
shared int disparities[tile * tile];
shared int row_sums[7][tile * cell_side];
shared float figures[near * near * REFINE_CELL_FIGURES];  // of the cells around
shared vec2 steps[9];                                     // of them: step and pull

void read_cells() {
  uint i = gl_LocalInvocationIndex, place = i / REFINE_CELL_FIGURES;
  if (place >= near * near) return;
  ivec2 cell = ivec2(gl_WorkGroupID.xy) - int(near / 2u) + ivec2(place % near, place / near);
  bool inside = all(greaterThanEqual(cell, ivec2(0))) && cell.x < int(cell_columns()) && cell.y < int(cell_rows());
  uint at = first_cell() + uint(cell.y) * cell_columns() + uint(cell.x);
  figures[i] = inside ? push.cells.at[REFINE_CELL_FIGURES * at + i % REFINE_CELL_FIGURES] : 0.0f;
}

float sure_of(float texture) {
  float least = max(texture, 1.0f);
  precise float sum = least + exact_quotient(REFINE_CELL_PRIOR * REFINE_CELL_PRIOR, least);
  return sum;
}

float determinant(float a, float b, float c, float d) {
  precise float first = a * b;
  precise float second = c * d;
  precise float difference = first - second;
  return difference;
}

/// Step and pull of a cell, from it and those around.
vec2 cell_step(ivec2 cell) {
  cell = clamp(cell, ivec2(0), ivec2(cell_columns(), cell_rows()) - 1) - ivec2(gl_WorkGroupID.xy) + int(near / 2u);
  precise float sums[REFINE_CELL_FIGURES] = float[REFINE_CELL_FIGURES](0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
  for (int y = cell.y - 1; y <= cell.y + 1; ++y)
    for (int x = cell.x - 1; x <= cell.x + 1; ++x)
      [[unroll]] for (uint k = 0u; k < REFINE_CELL_FIGURES; ++k)
        sums[k] = sums[k] + figures[(uint(y) * near + uint(x)) * REFINE_CELL_FIGURES + k];
  float step_sure = sure_of(sums[1]);
  precise float ridge = sums[4] * REFINE_PULL_RIDGE;
  precise float pull_sure = sure_of(sums[4]) + ridge;
  precise float most = step_sure * pull_sure;
  precise float least = most * (0.5f * REFINE_PULL_RIDGE);
  float divisor = max(determinant(step_sure, pull_sure, sums[3], sums[3]), least);
  return vec2(step_of(determinant(sums[0], pull_sure, sums[2], sums[3]), divisor),
              step_of(determinant(sums[2], step_sure, sums[0], sums[3]), divisor));
}

vec2 between(vec2 a, vec2 b, float t) {
  precise vec2 first = a * (1.0f - t);
  precise vec2 second = b * t;
  precise vec2 sum = first + second;
  return sum;
}

/// The cells' steps, between the middles of cells.
vec2 moved(ivec2 pixel) {
  ivec2 place = 2 * pixel - (REFINE_CELL - 1);
  vec2 share = vec2(place & 31) / 32.0f;
  ivec2 first = (place >> 5) - ivec2(gl_WorkGroupID.xy) + 1;
  int at = 3 * first.y + first.x;
  return between(between(steps[at], steps[at + 3], share.y), between(steps[at + 1], steps[at + 4], share.y), share.x);
}

void look_at_tile() {
  ivec2 origin = ivec2(gl_WorkGroupID.xy * cell_side) - int(reach);
  for (uint i = gl_LocalInvocationIndex; i < tile * tile; i += invocations) {
    ivec2 pixel = origin + ivec2(i % tile, i / tile);
    bool inside = all(greaterThanEqual(pixel, ivec2(0))) && pixel.x < int(push.width) && pixel.y < int(push.height);
    Evidence one = Evidence(false, 0, 0, 0, 0);
    if (inside) one = look(pixel.x, pixel.y, moved(pixel));
    slopes[i] = one.match_slope << 16 | one.slope & 0xffff;
    differences[i] = one.difference << 1 | int(one.counts);
    disparities[i] = one.q;
  }
}

void sum_rows() {
  for (uint i = gl_LocalInvocationIndex; i < tile * cell_side; i += invocations) {
    uint first = i / cell_side * tile + i % cell_side;
    int sums[7] = int[7](0, 0, 0, 0, 0, 0, 0);
    for (uint k = first; k < first + side; ++k) {
      int slope = slopes[k] << 16 >> 16, match_slope = slopes[k] >> 16, difference = differences[k] >> 1;
      sums[0] += slope;
      sums[1] += match_slope;
      sums[2] += difference;
      sums[3] += slope * difference;
      sums[4] += slope * match_slope;
      sums[5] += differences[k] & 1;
      sums[6] += disparities[k];
    }
    [[unroll]] for (uint k = 0u; k < 7u; ++k) row_sums[k][i] = sums[k];
  }
}

float refined(uvec2 local, int q) {
  int sums[7] = int[7](0, 0, 0, 0, 0, 0, 0);
  for (uint row = local.y; row < local.y + side; ++row)
    [[unroll]] for (uint k = 0u; k < 7u; ++k) sums[k] += row_sums[k][row * cell_side + local.x];
  float product = less_constant(sums[3], sums[0], sums[2], REFINE_WINDOW_SHARE);
  precise float texture = max(less_constant(sums[4], sums[0], sums[1], REFINE_WINDOW_SHARE), 0.0f) + REFINE_WINDOW_PRIOR;
  int off = sums[6] - sums[5] * q;
  bool is_near = off != 0 && abs(off) < sums[5] * REFINE_PHASES / 2;
  float mean = is_near ? exact_quotient(float(off), float(sums[5] * REFINE_PHASES)) : 0.0f;
  precise float smooth_disparity = float(q) / float(REFINE_PHASES) + mean;
  precise float found = smooth_disparity + step_of(product, texture);
  return max(found, float(push.min_disparity));
}

void main() {
  read_cells();
  barrier();
  if (gl_LocalInvocationIndex < 9u) {
    ivec2 cell = ivec2(gl_WorkGroupID.xy) - 1 + ivec2(gl_LocalInvocationIndex % 3u, gl_LocalInvocationIndex / 3u);
    steps[gl_LocalInvocationIndex] = cell_step(cell);
  }
  barrier();
  look_at_tile();
  barrier();
  sum_rows();
  barrier();
  uvec2 pixel = gl_GlobalInvocationID.xy, local = gl_LocalInvocationID.xy;
  if (pixel.x >= push.width || pixel.y >= push.height) return;
  uint own = (local.y + reach) * tile + local.x + reach, at = first_pixel() + pixel.y * push.width + pixel.x;
  push.disparity.at[at] = (differences[own] & 1) != 0 ? refined(local, disparities[own]) : push.filtered.at[at];
}
