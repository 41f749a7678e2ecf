// SPDX-License-Identifier: Apache-2.0
// Last pass of the refinement (match/refine.h): windows about the pixels find the rest of their disparities. A workgroup has the pixels of a
// cell; the evidence of these and of those around stands in shared memory, and then its sums along rows.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "lib/evidence.glsl"

const uint thread_rows = 2u, invocations = cell_side * cell_side / thread_rows, run = 4u;  // neighbours along a row that one invocation sums
layout(local_size_x = REFINE_CELL, local_size_y = REFINE_CELL / 2) in;

const uint reach = uint(REFINE_REACH), side = 2u * reach + 1u, tile = cell_side + 2u * reach;
shared uvec2 tile_evidence[tile * tile];
shared int row_sums[7][tile * cell_side];

void read_tile() {
  ivec2 origin = ivec2(gl_WorkGroupID.xy * cell_side) - int(reach);
  for (uint i = gl_LocalInvocationIndex; i < tile * tile; i += invocations) {
    ivec2 pixel = origin + ivec2(i % tile, i / tile);
    bool inside = all(greaterThanEqual(pixel, ivec2(0))) && pixel.x < int(push.width) && pixel.y < int(push.height);
    tile_evidence[i] = inside ? push.evidence.at[first_pixel() + uint(pixel.y) * push.width + uint(pixel.x)] : uvec2(0u);
  }
}

/// Adds, or with sign -1 takes off, a pixel's terms of the windows' sums.
void add_terms(uint at, int sign, inout int sums[7]) {
  Evidence one = unpacked_evidence(tile_evidence[at]);
  sums[0] += sign * one.slope;
  sums[1] += sign * one.match_slope;
  sums[2] += sign * one.difference;
  sums[3] += sign * (one.slope * one.difference);
  sums[4] += sign * (one.slope * one.match_slope);
  sums[5] += sign * int(one.counts);
  sums[6] += sign * one.q;
}

void sum_rows() {
  const uint runs = cell_side / run;
  for (uint i = gl_LocalInvocationIndex; i < tile * runs; i += invocations) {
    uint row = i / runs, column = i % runs * run, first = row * tile + column;
    int sums[7] = int[7](0, 0, 0, 0, 0, 0, 0);
    [[unroll]] for (uint k = 0u; k + 1u < side; ++k) add_terms(first + k, 1, sums);
    [[unroll]] for (uint x = 0u; x < run; ++x) {
      add_terms(first + x + side - 1u, 1, sums);
      [[unroll]] for (uint k = 0u; k < 7u; ++k) row_sums[k][row * cell_side + column + x] = sums[k];
      if (x + 1u < run) add_terms(first + x, -1, sums);
    }
  }
}

float refined(int sums[7], int q) {
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
  read_tile();
  barrier();
  sum_rows();
  barrier();
  uvec2 local = gl_LocalInvocationID.xy * uvec2(1u, thread_rows);
  int sums[7] = int[7](0, 0, 0, 0, 0, 0, 0);
  [[unroll]] for (uint k = 0u; k < 7u; ++k)
    for (uint row = local.y; row + 1u < local.y + side; ++row) sums[k] += row_sums[k][row * cell_side + local.x];
  [[unroll]] for (uint n = 0u; n < thread_rows; ++n) {
    uvec2 pixel = gl_WorkGroupID.xy * cell_side + local + uvec2(0u, n);
    [[unroll]] for (uint k = 0u; k < 7u; ++k) sums[k] += row_sums[k][(local.y + n + side - 1u) * cell_side + local.x];
    if (pixel.x < push.width && pixel.y < push.height) {
      uint at = first_pixel() + pixel.y * push.width + pixel.x;
      Evidence own = unpacked_evidence(tile_evidence[(local.y + n + reach) * tile + local.x + reach]);
      push.disparity.at[at] = own.counts ? refined(sums, own.q) : push.filtered.at[at];
    }
    [[unroll]] for (uint k = 0u; k < 7u; ++k) sums[k] -= row_sums[k][(local.y + n) * cell_side + local.x];
  }
}
