// SPDX-License-Identifier: Apache-2.0
// A projector's pattern as a pixel sees it: the mean over the pixel's square and the beam's disc, in place of samples of both
// (lib/light_shape.glsl, projected).
#ifndef KUAFU_PATTERN_MEAN_GLSL
#define KUAFU_PATTERN_MEAN_GLSL
#include "lib/light_shape.glsl"
#include "shared/gbuffer_record.h"

/// The place of a disc among the levels: level 0 is a point, level l a disc of 2^((l - 1) / 2) pixels; between two of them by variance.
float pattern_level(float diameter_px) {
  float square = diameter_px * diameter_px;
  if (square <= 1.0f) return square;
  uint bits = floatBitsToUint(square);  // 2^l times 1 to 2
  return float(bits >> 23u) - 127.0f + uintBitsToFloat((bits & 0x7fffffu) | 0x3f800000u);
}

float pattern_mean_of_level(IN(PatternMeans) p, uint level, vec2 place) {
  vec2 base = floor(place), f = place - base;
  int x = int(base.x), y = int(base.y), width = int(p.width);
  bool inside = x >= 0 && y >= 0 && x + 1 < width && y + 1 < int(p.height);
  int first = inside ? (int(level) * int(p.height) + y) * width + x : 0;
  float value = mix(mix(p.means.at[first], p.means.at[first + 1], f.x), mix(p.means.at[first + width], p.means.at[first + width + 1], f.x), f.y);
  return inside ? value : 0.0f;
}

/// As lib/light_shape.glsl's `projected`; `away` is the way from the projector to the surface.
float projected_mean(IN(PatternMeans) p, IN(LightShape) s, vec3 away) {
  vec3 d = to_light_frame(s, away);
  vec2 pixel;
  if (!pattern_pixel(s, d, pixel)) return 0.0f;
  float diameter_px = s.radius_m > 0.0f && s.focus_m > 0.0f ? 2.0f * s.focal.x * s.radius_m * abs(1.0f / d.z - 1.0f / s.focus_m) : 0.0f;
  float level = min(pattern_level(diameter_px), float(p.levels - 1u));
  uint low = min(uint(level), p.levels - 1u), high = min(low + 1u, p.levels - 1u);
  vec2 place = pixel / p.step_px + 1.0f;  // a border of means lies around the pattern
  float value = mix(pattern_mean_of_level(p, low, place), pattern_mean_of_level(p, high, place), level - float(low));
  if (s.falloff == 0.0f) return value;
  float cosine = d.z / length(d);
  return value * (s.falloff == 1.0f ? cosine : pow(cosine, s.falloff));
}
#endif
