// SPDX-License-Identifier: Apache-2.0
// The point spread of a tile along both axes, in shared memory, of light that vignetting dims on the way there.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/distortion.glsl"
#include "shared/optics_record.h"

const uint tile = optics_tile_px, group_rows = 8u, widest = tile + 2u * optics_most_tiled_radius_px;
layout(local_size_x = tile, local_size_y = group_rows) in;
layout(push_constant, scalar) uniform Push { OpticsPush push; };
layout(constant_id = 0) const uint step = optics_psf;
#include "stage/optics.glsl"

shared float light[widest * widest];
shared float along_rows[widest * tile];
shared float kernel[optics_most_tiled_radius_px + 1u];  // of a view that has one

float weight_at(IN(OpticsRecord) f, uint column, uint row, int k) {
  return f.psf_kernels_per_variance == 0.0f ? kernel[abs(k)] : psf_weight(f, column, row, uint(abs(k)));
}

void main() {
  uint columns = (push.width + tile - 1u) / tile, rows = (push.height + tile - 1u) / tile;
  uint group = gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x, view = group / (columns * rows);
  if (view >= push.view_count) return;
  IN(OpticsRecord) f = push.optics.at[view];
  uint first_column = group % columns * tile, first_row = group / columns % rows * tile, first_pixel = view * pixels_per_view();
  int radius = int(f.psf_radius), last_column = int(push.width) - 1, last_row = int(push.height) - 1;
  uint side = tile + 2u * f.psf_radius, by_side = (1u << 20) / side + 1u;  // exact for what a tile holds
  if (gl_LocalInvocationIndex <= f.psf_radius) kernel[gl_LocalInvocationIndex] = push.kernels.at[f.psf_kernels + gl_LocalInvocationIndex];
  for (uint c = 0u; c < push.channels; ++c) {
    for (uint i = gl_LocalInvocationIndex; i < side * side; i += tile * group_rows) {
      uint v = i * by_side >> 20, u = i - v * side;
      uint column = uint(clamp(int(first_column + u) - radius, 0, last_column)), row = uint(clamp(int(first_row + v) - radius, 0, last_row));
      float value = push.from.at[(first_pixel + row * push.width + column) * push.channels + c];
      light[i] = step == optics_vignetted_psf ? value * vignetting_factor(f, column, row) : value;
    }
    barrier();
    for (uint v = gl_LocalInvocationID.y; v < side; v += group_rows) {
      uint row = uint(clamp(int(first_row + v) - radius, 0, last_row));
      float sum = 0.0f;
      for (int k = -radius; k <= radius; ++k) {
        uint column = uint(clamp(int(first_column + gl_LocalInvocationID.x) + k, 0, last_column));
        sum += weight_at(f, column, row, k) * light[int(v * side + gl_LocalInvocationID.x) + radius + k];
      }
      along_rows[v * tile + gl_LocalInvocationID.x] = sum;
    }
    barrier();
    uint column = first_column + gl_LocalInvocationID.x;
    for (uint v = gl_LocalInvocationID.y; v < tile; v += group_rows) {
      if (column >= push.width || first_row + v >= push.height) continue;
      float sum = 0.0f;
      for (int k = -radius; k <= radius; ++k) {
        uint row = uint(clamp(int(first_row + v) + k, 0, last_row));
        sum += weight_at(f, column, row, k) * along_rows[(int(v) + radius + k) * int(tile) + int(gl_LocalInvocationID.x)];
      }
      push.to.at[(first_pixel + (first_row + v) * push.width + column) * push.channels + c] = sum;
    }
  }
}
