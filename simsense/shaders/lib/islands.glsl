// SPDX-License-Identifier: Apache-2.0
// Islands of the speckle filter (cpu/checks/checks.h) by a union-find that all pixels build at once: parents only ever move to smaller
// pixels of the same island (Playne and Hawick, A new algorithm for parallel connected-component labelling on GPUs, IEEE TPDS 29(6), 2018),
// so that the islands do not depend on the order. Wants PARENT(i) and DISPARITY(i), of a tile or of the images.
#ifndef SIMSENSE_ISLANDS_GLSL
#define SIMSENSE_ISLANDS_GLSL
#include "lib/clean.glsl"

uint root(uint pixel) {
  for (uint next = PARENT(pixel); next != pixel; next = PARENT(pixel)) pixel = next;
  return pixel;
}

void join(uint a, uint b) {
  for (;;) {
    a = root(a), b = root(b);
    if (a == b) return;
    uint high = max(a, b), low = min(a, b), before = atomicMin(PARENT(high), low);
    if (before == high) return;
    a = low, b = before;  // another pixel moved it meanwhile: its parent belongs here too
  }
}

bool connected(uint a, uint b) {
  float da = DISPARITY(a), db = DISPARITY(b);
  return da != push.invalid && db != push.invalid && abs(da - db) <= push.max_diff_px;
}

/// Joins a pixel with the one that lies `over` before it, unless those `along` before both are connected with them and do it.
void join_over(uint pixel, uint over, uint along, bool has_along) {
  if (!connected(pixel, pixel - over)) return;
  bool joined = has_along && connected(pixel, pixel - along) && connected(pixel - along, pixel - along - over) &&
                connected(pixel - over, pixel - along - over);
  if (!joined) join(pixel, pixel - over);
}
#endif
