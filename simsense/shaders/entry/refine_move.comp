// SPDX-License-Identifier: Apache-2.0
// Second pass of the refinement (match/refine.h): pixels move by their cells' steps, and leave what they add to windows. A workgroup is a cell.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/evidence.glsl"

layout(local_size_x = REFINE_CELL, local_size_y = REFINE_CELL) in;

const uint near = 5u;  // cells that a workgroup sees along a side
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

void main() {
  read_cells();
  barrier();
  if (gl_LocalInvocationIndex < 9u) {
    ivec2 cell = ivec2(gl_WorkGroupID.xy) - 1 + ivec2(gl_LocalInvocationIndex % 3u, gl_LocalInvocationIndex / 3u);
    steps[gl_LocalInvocationIndex] = cell_step(cell);
  }
  barrier();
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (pixel.x >= int(push.width) || pixel.y >= int(push.height)) return;
  push.evidence.at[first_pixel() + uint(pixel.y) * push.width + uint(pixel.x)] = packed_evidence(look(pixel.x, pixel.y, moved(pixel)));
}
