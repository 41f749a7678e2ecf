// SPDX-License-Identifier: Apache-2.0
// A clear coat (KHR_materials_clearcoat): a GGX lobe with the exact Fresnel reflectance of index 1.5, over all of a surface but its glass.
// Lobes below it are dimmed by the larger of the coat's two albedos, towards the viewer and towards the light: reciprocal, and a white mirror
// below loses nothing. A diffuse base is dimmed by what all layers over it reflect together (lib/bsdf.glsl). The coat has normals of its own:
// its cosines are to them, directions are those of the frame of the surface below.
#ifndef KUAFU_CLEARCOAT_GLSL
#define KUAFU_CLEARCOAT_GLSL
#include "lib/albedo_table.glsl"
#include "lib/frame.glsl"
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
  vec3 normal;      // on the viewer's side
};

bool wears_clearcoat(IN(Clearcoat) c) { return (features & feature_clearcoat) != 0u && c.weight > 0.0f; }
bool has_clearcoat_lobe(IN(Clearcoat) c) { return wears_clearcoat(c) && c.alpha >= mirror_alpha; }

/// What the coat reflects of light at this cosine, one facet and several.
float clearcoat_albedo(IN(Clearcoat) c, Vec2Array table, float cosine) { return c.weight * albedo_of_layer(c.rows, table, cosine); }

/// Its mean over the hemisphere.
float clearcoat_mean(IN(Clearcoat) c, Vec2Array table) { return c.weight * mean_of_layer(c.rows, table); }

float clearcoat_cosine(IN(Clearcoat) c, vec3 w) { return abs(dot(c.normal, w)); }

float rest_of_facet(Vec2Array table, float cosine, float roughness) {
  vec2 e = lobe_albedo(table, cosine, roughness);
  return max(1.0f - e.x - e.y, 0.0f);
}

Clearcoat make_clearcoat(IN(MaterialPoint) m, Vec2Array table, vec3 wo, float share) {
  Clearcoat c = Clearcoat(0.0f, share, 0.0f, 0.0f, AlbedoRows(0, 0, 0.0f, 0.0f), 0.0f, 0.0f, 0.0f, m.clearcoat_normal);
  if ((features & feature_clearcoat) == 0u || m.clearcoat == 0.0f || share == 0.0f) return c;
  c.weight = m.clearcoat;
  c.roughness = m.clearcoat_roughness;
  c.alpha = c.roughness * c.roughness;
  c.rows = find_layer_rows(clearcoat_ior, c.roughness);
  float cos_o = clearcoat_cosine(c, wo);
  c.albedo = clearcoat_albedo(c, table, cos_o);
  float mean = lobe_mean(table, c.roughness), reflectance = (clearcoat_ior - 1.0f) / (4.08567f + 1.00071f * clearcoat_ior);
  float comes_back = reflectance * reflectance * mean / (1.0f - reflectance * (1.0f - mean));
  c.rest = comes_back * rest_of_facet(table, cos_o, c.roughness) / max(1.0f - mean, 1e-4f);
  return c;
}

/// What lobes below it keep.
float under_clearcoat(IN(Clearcoat) c, Vec2Array table, vec3 wi) {
  return wears_clearcoat(c) ? 1.0f - max(c.albedo, clearcoat_albedo(c, table, clearcoat_cosine(c, wi))) : 1.0f;
}

/// f cos of the coat that is no mirror, and the density of its facets' samples.
float evaluate_clearcoat(IN(Clearcoat) c, Vec2Array table, vec3 wo, vec3 wi, OUT(float) pdf) {
  Frame frame = frame_around(c.normal);
  vec3 o = to_local(frame, wo), i = to_local(frame, wi), h = normalize(o + i);
  pdf = 0.0f;
  if (i.z <= 0.0f) return 0.0f;
  float cos_t, reflectance = fresnel_dielectric(min(dot(o, h), 1.0f), 1.0f / clearcoat_ior, cos_t);
  pdf = ggx_reflection_pdf(o, h, c.alpha);
  float facets = reflectance * ggx_distribution(h, c.alpha) * ggx_visibility(o.z, i.z, c.alpha);
  return c.share * c.weight * i.z * (facets + c.rest * rest_of_facet(table, i.z, c.roughness) / pi);
}

/// A direction by the coat that is no mirror.
vec3 sample_clearcoat(IN(Clearcoat) c, vec3 wo, vec2 u) {
  Frame frame = frame_around(c.normal);
  vec3 o = to_local(frame, wo);
  return to_world(frame, reflect(-o, sample_visible_normal(o, c.alpha, u)));
}

float clearcoat_mirror(IN(Clearcoat) c, vec3 wo) {
  float cos_t;
  return c.share * c.weight * fresnel_dielectric(min(clearcoat_cosine(c, wo), 1.0f), 1.0f / clearcoat_ior, cos_t);
}
#endif
