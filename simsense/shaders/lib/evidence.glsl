// SPDX-License-Identifier: Apache-2.0
// What a pixel adds to the windows of the refinement (match/refine.h).
#ifndef SIMSENSE_EVIDENCE_GLSL
#define SIMSENSE_EVIDENCE_GLSL
#include "lib/counts.glsl"
#include "lib/exact_ratio.glsl"
#include "shared/refine_push.h"

layout(push_constant, scalar) uniform Push { RefinePush push; };

const uint cell_side = uint(REFINE_CELL);

uint cell_columns() { return (push.width + cell_side - 1u) / cell_side; }
uint cell_rows() { return (push.height + cell_side - 1u) / cell_side; }
uint first_pixel() { return gl_WorkGroupID.z * push.width * push.height; }
uint first_cell() { return gl_WorkGroupID.z * cell_columns() * cell_rows(); }

int count_of(UintArray image, uint first_byte, uint bits, int x, int y) {
  uint column = uint(clamp(x, 0, int(push.width) - 1));
  return count_at(image, first_byte, bits, gl_WorkGroupID.z * push.image_stride + uint(y) * push.image_pitch + column);
}

int left_count(int x, int y) { return count_of(push.left_image, push.left_byte, push.left_bits, x, y); }
int right_count(int x, int y) { return count_of(push.right_image, push.right_byte, push.right_bits, x, y); }

struct Evidence {
  bool counts;
  int q;  // disparity, 32nds of a pixel
  int slope, match_slope, difference;
};

/// q takes 19 bits, a difference 12.
uvec2 packed_evidence(Evidence one) {
  return uvec2(uint(one.match_slope << 16 | one.slope & 0xffff), uint(one.q << 13 | (one.difference & 0xfff) << 1 | int(one.counts)));
}

Evidence unpacked_evidence(uvec2 words) {
  int slopes = int(words.x), rest = int(words.y);
  return Evidence((rest & 1) != 0, rest >> 13, slopes << 16 >> 16, slopes >> 16, rest << 19 >> 20);
}

int phase_of(float disparity) {
  precise float phases = disparity * float(REFINE_PHASES);
  precise float above = phases + 0.5f;
  return int(floor(above));
}

/// The shape of the pull to whole pixels, by a disparity in 32nds of a pixel.
int pull_at(int q) {
  int off = (q & (REFINE_PHASES - 1)) - REFINE_PHASES / 2, far = abs(off);
  int size = min(5 * (REFINE_PHASES / 2 - far), far);
  return off < 0 ? size : -size;
}

/// The evidence of a pixel of the image. moved: px added to its disparity, and with the pull's shape.
Evidence look(int x, int y, vec2 moved) {
  Evidence none = Evidence(false, 0, 0, 0, 0);
  float disparity = push.filtered.at[first_pixel() + uint(y) * push.width + uint(x)];
  if (disparity == push.invalid) return none;
  precise float shape = float(pull_at(phase_of(disparity))) * REFINE_PULL_UNIT;
  precise float freed = moved.y * shape;
  precise float stepped = disparity + moved.x;
  precise float at = stepped + freed;
  Evidence one = none;
  one.q = phase_of(at);
  int place = REFINE_PHASES * x - one.q, f = place & (REFINE_PHASES - 1), u = REFINE_PHASES - f, i = place >> 5;
  if (i < 1 || i + 2 >= int(push.width)) return none;
  one.counts = true;
  ivec4 c = ivec4(right_count(i - 1, y), right_count(i, y), right_count(i + 1, y), right_count(i + 2, y));
  ivec4 weights = ivec4(u * u * u, 3 * f * f * f - 192 * f * f + 131072, 3 * u * u * u - 192 * u * u + 131072, f * f * f);
  ivec4 slopes = ivec4(-u * u, 3 * f * f - 128 * f, -3 * u * u + 128 * u, f * f);
  ivec4 values = weights * c, rises = slopes * c;
  int before = left_count(x - 1, y), after = left_count(x + 1, y);
  int smooth_count = 32768 * (before + 4 * left_count(x, y) + after);
  int rise = left_count(x + 2, y) - left_count(x - 2, y) + 2 * (after - before) - (left_count(x + 4, y) - left_count(x - 4, y));
  one.slope = (rise + int((1u << extra_bits) >> 1)) >> extra_bits;
  one.match_slope = (rises.x + rises.y + rises.z + rises.w + int(128u << extra_bits)) >> (8u + extra_bits);
  int difference = (values.x + values.y + values.z + values.w - smooth_count + int(2048u << extra_bits)) >> (12u + extra_bits);
  one.difference = clamp(difference, -REFINE_LARGEST_DIFFERENCE, REFINE_LARGEST_DIFFERENCE);
  return one;
}

/// sum g e or sum g w, less what a constant makes of them.
float less_constant(int sum, int a, int b, float share) {
  precise float product = float(a) * float(b);
  precise float part = product * share;
  precise float rest = float(sum) - part;
  return rest;
}

float step_of(float product, float texture) {
  precise float divisor = 6.0f * texture;
  return clamp(exact_quotient(product, divisor), -REFINE_LARGEST_STEP, REFINE_LARGEST_STEP);
}
#endif
