// SPDX-License-Identifier: Apache-2.0
// No measurement where the left image shows nothing (cpu/checks/checks.h): blank squares are found, then what lies
// inside of them along rows, and with that along columns is dropped.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/image.glsl"
#include "shared/map_push.h"

layout(local_size_x = 32, local_size_y = 8) in;
layout(push_constant, scalar) uniform Push { TexturePush push; };

const int window_reach = int(TEXTURE_SIDE / 2u), drop_reach = window_reach - int(TEXTURE_EDGE);

uint pixel_of(uint n, int x, int y) { return (n * push.height + uint(y)) * push.width + uint(x); }

/// Looks no further than it must: most squares have texture in their first rows.
bool is_blank(int x, int y, uint n) {
  uint darkest = 0xffffffffu, brightest = 0u;
  for (int v = max(0, y - window_reach); v <= min(int(push.height) - 1, y + window_reach); ++v)
    for (int u = max(0, x - window_reach); u <= min(int(push.width) - 1, x + window_reach); ++u) {
      uint value = uint(load_element(push.left, element_of(push.left, n, uint(u), uint(v))));
      darkest = min(darkest, value);
      brightest = max(brightest, value);
      if (brightest - darkest >= push.min_texture_dn) return false;
    }
  return true;
}

bool is_beside_blank(int x, int y, uint n) {
  for (int u = max(0, x - drop_reach); u <= min(int(push.width) - 1, x + drop_reach); ++u)
    if (uint(push.blank.at[pixel_of(n, u, y)]) != 0u) return true;
  return false;
}

bool is_inside_of_blank(int x, int y, uint n) {
  for (int v = max(0, y - drop_reach); v <= min(int(push.height) - 1, y + drop_reach); ++v)
    if (uint(push.row_blank.at[pixel_of(n, x, v)]) != 0u) return true;
  return false;
}

void main() {
  int x = int(gl_GlobalInvocationID.x), y = int(gl_GlobalInvocationID.y);
  uint n = gl_WorkGroupID.z;
  if (x >= int(push.width) || y >= int(push.height)) return;
  uint at = pixel_of(n, x, y);
  if (push.step == TEXTURE_PASS_FIND) {
    push.blank.at[at] = uint8_t(is_blank(x, y, n) ? 1u : 0u);
    return;
  }
  if (push.step == TEXTURE_PASS_ROWS) {
    push.row_blank.at[at] = uint8_t(is_beside_blank(x, y, n) ? 1u : 0u);
    return;
  }
  if (push.disparity.at[at] == push.invalid || !is_inside_of_blank(x, y, n)) return;
  push.disparity.at[at] = push.invalid;
  if ((push.maps & MAPS_CONFIDENCE) != 0u) push.confidence.at[at] = 0.0f;
  if ((push.maps & MAPS_REASON) != 0u) push.reason.at[at] = uint8_t(REASON_LOW_TEXTURE);
}
