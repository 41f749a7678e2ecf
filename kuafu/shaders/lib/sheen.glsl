// SPDX-License-Identifier: Apache-2.0
// A lobe of fibres (KHR_materials_sheen) over all of a surface but its glass: Estevez and Kulla, "Production Friendly Microfacet Sheen BRDF", 2017.
// Where its albedo would be above 1, as at grazing angles with low roughness, it is divided by it, for the viewer and for the light. Lobes below are
// dimmed by the larger of its two albedos, as those below a clear coat.
#ifndef KUAFU_SHEEN_GLSL
#define KUAFU_SHEEN_GLSL
#include "lib/albedo_table.glsl"
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

const int sheen_roughnesses = int(sheen_albedo_roughnesses);
const float least_sheen_roughness = 0.01f * float(sheen_least_percent);

struct Sheen {
  Spectrum color;
  float most;   // of the colour's channels
  float share;  // of the surface that it covers
  float roughness, alpha;
  float albedo;  // of white fibres, towards the viewer
  float taken;   // towards the viewer, of what it covers
  float chance;  // of taking it, where the base is taken
};

bool wears_sheen(IN(Sheen) s) { return (features & feature_sheen) != 0u && s.most > 0.0f; }

/// Albedo of white fibres by Estevez and Kulla's formulas.
float sheen_albedo(Vec2Array table, float roughness, float cosine) {
  float x = sqrt(clamp(cosine, 0.0f, 1.0f)) * float(lobe_size - 1), y = (roughness - least_sheen_roughness) / (1.0f - least_sheen_roughness) * float(sheen_roughnesses - 1);
  int column = table_cell(x, lobe_size), line = table_cell(y, sheen_roughnesses), row = int(sheen_albedo_first) + line * lobe_size + column;
  vec2 e = mix(table.at[row], table.at[row + lobe_size], y - float(line));
  return mix(e.x, e.y, x - float(column));
}

Sheen make_sheen(IN(MaterialPoint) m, Vec2Array table, float cos_o, float share) {
  Sheen s = Sheen(Spectrum(0.0f), 0.0f, share, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f);
  if ((features & feature_sheen) == 0u || share == 0.0f || max_component(m.sheen) == 0.0f) return s;
  s.color = m.sheen;
  s.most = max_component(m.sheen);
  s.roughness = clamp(m.sheen_roughness, least_sheen_roughness, 1.0f);
  s.alpha = s.roughness * s.roughness;
  s.albedo = sheen_albedo(table, s.roughness, cos_o);
  s.taken = s.most * min(s.albedo, 1.0f);
  return s;
}

/// What lobes below it keep.
float under_sheen(IN(Sheen) s, Vec2Array table, float cos_i) {
  return wears_sheen(s) ? 1.0f - max(s.taken, s.most * min(sheen_albedo(table, s.roughness, cos_i), 1.0f)) : 1.0f;
}

float sheen_masking_fit(float x, float alpha) {
  float smoother = (1.0f - alpha) * (1.0f - alpha);
  float a = mix(21.5473f, 25.3245f, smoother), b = mix(3.82987f, 3.32435f, smoother), c = mix(0.19823f, 0.16801f, smoother);
  float d = mix(-1.97760f, -1.27393f, smoother), e = mix(-4.32054f, -4.85967f, smoother);
  return a / (1.0f + b * pow(x, c)) + d * x + e;
}

/// Smith's function of a direction, fitted.
float sheen_masking(float cosine, float alpha) {
  if (cosine < 0.5f) return exp(sheen_masking_fit(cosine, alpha));
  return exp(2.0f * sheen_masking_fit(0.5f, alpha) - sheen_masking_fit(1.0f - cosine, alpha));
}

/// f cos of the lobe, whose sampler is even over the hemisphere.
Spectrum evaluate_sheen(IN(Sheen) s, Vec2Array table, vec3 wo, vec3 wi) {
  vec3 h = normalize(wo + wi);
  float sine = sqrt(max(1.0f - h.z * h.z, 1e-12f)), distribution = (2.0f + 1.0f / s.alpha) * pow(sine, 1.0f / s.alpha) / (2.0f * pi);
  float free = 1.0f / (1.0f + sheen_masking(wo.z, s.alpha) + sheen_masking(wi.z, s.alpha));
  float scale = max(s.albedo, 1.0f) * max(sheen_albedo(table, s.roughness, wi.z), 1.0f);
  return s.color * (s.share * distribution * free / (4.0f * wo.z * scale));
}

vec3 sample_hemisphere(vec2 u) { return vec3(sqrt(max(1.0f - u.x * u.x, 0.0f)) * unit_circle(u.y), u.x); }
#endif
