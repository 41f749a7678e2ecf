// SPDX-License-Identifier: Apache-2.0
// Light that arrives from a point or a projector, before visibility.
#ifndef KUAFU_LIGHT_GLSL
#define KUAFU_LIGHT_GLSL
#include "lib/spectrum.glsl"
#include "lib/texture.glsl"

struct LightSample {
  vec3 direction;  // towards the light
  float distance_m;
  Spectrum irradiance;  // on a surface that faces the light, W/m^2
  float pdf;            // per solid angle; 0: the light has no extent
  uint light_group;     // of a light_mesh alone
};

// I / d^2; a projector's I is its pattern's value where the direction falls (spec: no falloff of its own).
LightSample light_at(IN(LightRecord) light, vec3 position) {
  LightSample s;
  vec3 to_light = light.position - position;
  float distance_squared = max(dot(to_light, to_light), 1e-12f);
  s.distance_m = sqrt(distance_squared);
  s.pdf = 0.0f;
  s.direction = to_light / s.distance_m;
  s.irradiance = band_of(light.intensity) / distance_squared;
  if (light.kind == light_projector) {
    vec3 q = vec3(dot(light.world_to_pixel[0], -to_light), dot(light.world_to_pixel[1], -to_light), dot(light.world_to_pixel[2], -to_light));
    Pattern pattern = Pattern(light.pattern, light.width, light.height, light.pattern_bits);
    s.irradiance *= q.z > 0.0f ? pattern_bilinear(pattern, xy(q) / q.z) : 0.0f;
  }
  return s;
}

struct LightChoice {
  uint index;
  float probability;  // 0: none
};

LightChoice select_light(LightArray lights, IN(EnvironmentRecord) environment, bool skip_projectors, float u) {
  uint begin = environment.first_light + (skip_projectors ? environment.projector_count : 0u);
  uint low = begin, high = environment.first_light + environment.light_count;
  while (low + 1u < high) {
    uint middle = (low + high) / 2u;
    IN(LightRecord) before = lights.at[middle - 1u];
    if (u < (skip_projectors ? before.other_cumulative : before.cumulative)) high = middle;
    else low = middle;
  }
  if (low >= environment.first_light + environment.light_count) return LightChoice(0u, 0.0f);
  return LightChoice(low, skip_projectors ? lights.at[low].other_probability : lights.at[low].probability);
}

/// The light that shadow ray `k` of a vertex asks. With few lights: the k-th. Else every projector where the camera looks, exactly, and one light by power.
LightChoice vertex_light(LightArray lights, IN(EnvironmentRecord) environment, uint k, bool select, bool all_delta, float u) {
  if (!select || (all_delta && k < environment.projector_count))
    return LightChoice(environment.first_light + k, k < environment.light_count ? 1.0f : 0.0f);
  if (k != (all_delta ? environment.projector_count : 0u)) return LightChoice(0u, 0.0f);
  return select_light(lights, environment, all_delta, u);
}
#endif
