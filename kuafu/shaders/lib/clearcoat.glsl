// SPDX-License-Identifier: Apache-2.0
// A clear coat (KHR_materials_clearcoat): a GGX lobe with the exact Fresnel reflectance of index 1.5, over all of a surface but its glass.
// Lobes below it are dimmed by the larger of the coat's two albedos, towards the eye and towards the light: reciprocal, and a white mirror
// below loses nothing. A diffuse base is dimmed by what all layers over it reflect together (lib/bsdf.glsl).
#ifndef KUAFU_CLEARCOAT_GLSL
#define KUAFU_CLEARCOAT_GLSL
#include "lib/albedo_table.glsl"
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

const float clearcoat_ior = 1.5f;

struct Clearcoat {
  float weight;     // over what it covers
  float share;      // of the surface that it covers
  float roughness, alpha;
  AlbedoRows rows;  // of a layer's albedos
  float albedo;     // towards the viewer, of what it covers
  float rest;       // what one facet leaves of white light, towards the viewer, times the share of it that comes back, over its mean
  float chance;     // of taking it
};

bool wears_clearcoat(IN(Clearcoat) c) { return (features & feature_clearcoat) != 0u && c.weight > 0.0f; }
bool has_clearcoat_lobe(IN(Clearcoat) c) { return wears_clearcoat(c) && c.alpha >= mirror_alpha; }

/// What the coat reflects of light at this cosine, one facet and several.
float clearcoat_albedo(IN(Clearcoat) c, Vec2Array table, float cosine) { return c.weight * albedo_of_layer(c.rows, table, cosine); }

/// Its mean over the hemisphere.
float clearcoat_mean(IN(Clearcoat) c, Vec2Array table) { return c.weight * mean_of_layer(c.rows, table); }

float rest_of_facet(Vec2Array table, float cosine, float roughness) {
  vec2 e = lobe_albedo(table, cosine, roughness);
  return max(1.0f - e.x - e.y, 0.0f);
}

Clearcoat make_clearcoat(IN(MaterialPoint) m, Vec2Array table, float cos_o, float share) {
  Clearcoat c = Clearcoat(0.0f, share, 0.0f, 0.0f, AlbedoRows(0, 0, 0.0f, 0.0f), 0.0f, 0.0f, 0.0f);
  if ((features & feature_clearcoat) == 0u || m.clearcoat == 0.0f || share == 0.0f) return c;
  c.weight = m.clearcoat;
  c.roughness = m.clearcoat_roughness;
  c.alpha = c.roughness * c.roughness;
  c.rows = find_layer_rows(clearcoat_ior, c.roughness);
  c.albedo = clearcoat_albedo(c, table, cos_o);
  float mean = lobe_mean(table, c.roughness), reflectance = (clearcoat_ior - 1.0f) / (4.08567f + 1.00071f * clearcoat_ior);
  float comes_back = reflectance * reflectance * mean / (1.0f - reflectance * (1.0f - mean));
  c.rest = comes_back * rest_of_facet(table, cos_o, c.roughness) / max(1.0f - mean, 1e-4f);
  return c;
}

/// What lobes below it keep.
float under_clearcoat(IN(Clearcoat) c, Vec2Array table, float cos_i) {
  return wears_clearcoat(c) ? 1.0f - max(c.albedo, clearcoat_albedo(c, table, cos_i)) : 1.0f;
}

/// f cos of the coat that is no mirror, and the density of its facets' samples.
float evaluate_clearcoat(IN(Clearcoat) c, Vec2Array table, vec3 wo, vec3 wi, OUT(float) pdf) {
  vec3 h = normalize(wo + wi);
  float cos_t, reflectance = fresnel_dielectric(min(dot(wo, h), 1.0f), 1.0f / clearcoat_ior, cos_t);
  pdf = ggx_reflection_pdf(wo, h, c.alpha);
  float facets = reflectance * ggx_distribution(h, c.alpha) * ggx_visibility(wo.z, wi.z, c.alpha);
  return c.share * c.weight * wi.z * (facets + c.rest * rest_of_facet(table, wi.z, c.roughness) / pi);
}

float clearcoat_mirror(IN(Clearcoat) c, float cosine) {
  float cos_t;
  return c.share * c.weight * fresnel_dielectric(min(cosine, 1.0f), 1.0f / clearcoat_ior, cos_t);
}
#endif
