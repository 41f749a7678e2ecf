// SPDX-License-Identifier: Apache-2.0
// glTF 2.0's material as one BSDF in the shading frame (z on the viewer's side): diffuse base, GGX lobes of layer and metal, glass.
// A dielectric's layer reflects as Fresnel says of its index, times specular. Its base gets and gives what the layer lets through,
// (1 - E(wo)) (1 - E(wi)) / (1 - mean of E) with the layer's directional albedo E: reciprocal, and a white base loses nothing (Kelemen and
// Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model", 2001). Both sides of a surface wear the layer. A glass share
// (transmission) is in lib/glass.glsl, a coat over all else in lib/clearcoat.glsl. What the base lets through (diffuse_transmission) passes the layers of both
// sides, as what it gives back passes one twice. Light that meets several microfacets comes back as one more diffuse lobe (Kulla and Conty, "Revisiting
// Physically Based Shading at Imageworks", 2017).
#ifndef KUAFU_BSDF_GLSL
#define KUAFU_BSDF_GLSL
#include "lib/albedo_table.glsl"
#include "lib/clearcoat.glsl"
#include "lib/glass.glsl"
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

struct Bsdf {
  Spectrum diffuse;             // albedo of the base
  Spectrum metal;               // reflectance at normal incidence, and
  float metallic;               // at grazing (Schlick's Fresnel)
  float layer;                  // share of the dielectric layer
  float coat, coat_eta;         // the layer over the base: weight, and 1 / index
  AlbedoRows layer_rows;        // of its albedos
  float coat_albedo;            // towards the viewer
  vec2 lobe_albedo;             // metal's split sum, towards the viewer
  float base_scale;             // 1 / (1 - mean of the coat's albedo)
  float roughness, alpha;
  Spectrum multiple;            // of light that met several facets: share of 1 - E that comes back
  float multiple_scale;         // 1 / (1 - mean of E)
  float diffuse_roughness;
  float subsurface;             // share that goes below the surface
  Spectrum beyond;              // albedo of the base for light that leaves on the other side
  float beyond_chance;          // of that, where the base is taken
  Glass glass;
  Clearcoat clearcoat;
};

struct BsdfSample {
  vec3 direction;
  Spectrum weight;  // f cos / pdf
  float pdf;        // of all lobes that are no mirrors; 0 with delta
  bool delta, transmitted;
};

/// Share of light that the layer reflects, single and multiple scattering.
float layer_albedo(IN(Bsdf) b, Vec2Array table, float cosine) {
  float p = clamp(cosine, 0.0f, 1.0f) * float(lobe_size - 1);
  int c = table_cell(p, lobe_size);
  vec2 e = rows_entry(b.layer_rows, table, c, lobe_size);
  return mix(e.x, e.y, p - float(c));
}

/// What all layers over a dielectric's base reflect.
float coat_albedo(IN(Bsdf) b, Vec2Array table, float cosine) {
  float layer = b.coat == 0.0f ? 0.0f : b.coat * layer_albedo(b, table, cosine);
  if (!wears_clearcoat(b.clearcoat)) return layer;
  float over = clearcoat_albedo(b.clearcoat, table, cosine);
  return over + (1.0f - over) * layer;
}

/// Mean over the hemisphere of what a clear coat and the layer below it reflect together: their product by Gauss's rule of three points.
float clearcoat_and_layer_mean(IN(Bsdf) b, Vec2Array table) {
  float over = clearcoat_mean(b.clearcoat, table);
  if (b.coat == 0.0f) return over;
  float layer = b.coat * rows_entry(b.layer_rows, table, lobe_size - 1, lobe_size).x;
  float both = 5.0f * clearcoat_albedo(b.clearcoat, table, 0.33571f) * layer_albedo(b, table, 0.33571f);
  both += 8.0f * clearcoat_albedo(b.clearcoat, table, 0.70711f) * layer_albedo(b, table, 0.70711f);
  both += 5.0f * clearcoat_albedo(b.clearcoat, table, 0.94196f) * layer_albedo(b, table, 0.94196f);
  return over + layer - b.coat * both / 18.0f;
}

// F_avg^2 E / (1 - F_avg (1 - E))
Spectrum multiple_share(Spectrum average, float mean) { return average * average * mean / (Spectrum(1.0f) - average * (1.0f - mean)); }

bool is_mirror(IN(Bsdf) b) { return b.alpha < mirror_alpha; }
bool has_lobe(IN(Bsdf) b) { return b.metallic + b.layer > 0.0f; }
bool lets_through(IN(Bsdf) b) { return (features & feature_diffuse_transmission) != 0u && max_component(b.beyond) > 0.0f; }
/// Has a part that light from behind can be scattered by.
bool takes_light_behind(IN(Bsdf) b) { return is_rough(b.glass) || lets_through(b); }

/// What several facets scatter. Means of Fresnel's reflectance: Schlick's exactly, the layer's by Kulla and Conty's fit.
void set_multiple(INOUT(Bsdf) b, IN(MaterialPoint) m, Vec2Array table) {
  float mean = lobe_mean(table, b.roughness), layer_mean = (m.ior - 1.0f) / (4.08567f + 1.00071f * m.ior);
  b.multiple = multiple_share(m.base + (Spectrum(1.0f) - m.base) * (1.0f / 21.0f), mean) * b.metallic;
  b.multiple += Spectrum(b.layer * (layer_mean * layer_mean * mean / (1.0f - layer_mean * (1.0f - mean))));
  b.multiple_scale = 1.0f / max(1.0f - mean, 1e-4f);
}

/// What the base and several facets, the GGX lobe and the glass give towards the viewer; below: what goes below the surface.
vec3 lobe_weights(IN(Bsdf) b, OUT(float) below) {
  vec3 w = vec3(max_component(b.diffuse) * (1.0f - b.coat_albedo), 0.0f, b.glass.share);
  if (has_lobe(b)) {
    float under = wears_clearcoat(b.clearcoat) ? 1.0f - b.clearcoat.albedo : 1.0f;
    w.y = dot(b.lobe_albedo, vec2(max_component(b.metal), b.metallic)) * under;
    if (b.layer > 0.0f) w.y += b.layer / b.coat * (wears_clearcoat(b.clearcoat) ? b.coat_albedo - b.clearcoat.albedo : b.coat_albedo);
    w.x += max_component(b.multiple) * max(1.0f - b.lobe_albedo.x - b.lobe_albedo.y, 0.0f) * under;
  }
  if (lets_through(b)) w.x += max_component(b.beyond) * (1.0f - b.coat_albedo);
  below = (features & feature_subsurface) != 0u ? b.subsurface * (1.0f - b.coat_albedo) : 0.0f;
  return w;
}

/// Chances of taking the base and what several facets scatter, the GGX lobe and the glass; the rest goes below the surface, but for the
/// clear coat's.
vec3 lobe_chances(IN(Bsdf) b) {
  float below;
  vec3 w = lobe_weights(b, below);
  float sum = w.x + w.y + w.z + below;
  if (wears_clearcoat(b.clearcoat)) w *= 1.0f - b.clearcoat.chance;
  return sum > 0.0f ? w / sum : vec3(0.0f);
}

void wear_clearcoat(INOUT(Bsdf) b, Vec2Array table, float cos_o) {
  float below, over = b.clearcoat.share * b.clearcoat.albedo;
  b.coat_albedo = coat_albedo(b, table, cos_o);
  b.base_scale = 1.0f / (1.0f - min(clearcoat_and_layer_mean(b, table), 0.9999f));
  vec3 w = lobe_weights(b, below);
  b.clearcoat.chance = over / (over + w.x + w.y + w.z + below);
}

Bsdf make_bsdf(IN(MaterialPoint) m, Vec2Array table, float cos_o, bool front) {
  Bsdf b;
  float dielectric = (1.0f - m.metallic) * (1.0f - m.transmission);
  b.diffuse = m.base * dielectric;
  b.subsurface = 0.0f;
  if ((features & feature_subsurface) != 0u && front) {
    b.subsurface = m.subsurface * dielectric;
    b.diffuse *= 1.0f - m.subsurface;
  }
  b.beyond = Spectrum(0.0f);
  b.beyond_chance = 0.0f;
  if ((features & feature_diffuse_transmission) != 0u) {
    b.beyond = m.beyond * (dielectric * m.diffuse_transmission);
    b.diffuse *= 1.0f - m.diffuse_transmission;
    b.subsurface *= 1.0f - m.diffuse_transmission;
  }
  b.metallic = m.metallic;
  b.metal = m.base * m.metallic;
  b.coat = m.ior > 1.0f ? m.coat : 0.0f;
  b.layer = b.coat * dielectric;
  b.coat_eta = 1.0f / m.ior;
  b.roughness = m.roughness;
  b.alpha = m.roughness * m.roughness;
  b.multiple = Spectrum(0.0f);
  b.multiple_scale = 0.0f;
  b.lobe_albedo = vec2(0.0f);
  if (has_lobe(b)) {
    b.lobe_albedo = lobe_albedo(table, cos_o, b.roughness);
    if (!is_mirror(b)) set_multiple(b, m, table);
  }
  b.clearcoat = make_clearcoat(m, table, cos_o, 1.0f - (1.0f - m.metallic) * m.transmission);
  b.coat_albedo = 0.0f;
  b.base_scale = 1.0f;
  b.layer_rows = AlbedoRows(0, 0, 0.0f, 0.0f);
  if (b.layer > 0.0f) {
    b.layer_rows = find_rows((m.ior - 1.0f) / (m.ior + 1.0f), layer_size, b.roughness, layer_size, int(layer_albedo_first), lobe_size);
    b.coat_albedo = coat_albedo(b, table, cos_o);
    b.base_scale = 1.0f / (1.0f - b.coat * min(rows_entry(b.layer_rows, table, lobe_size - 1, lobe_size).x, 0.9999f));
  }
  b.diffuse_roughness = (features & feature_materials) != 0u ? m.diffuse_roughness : 0.0f;
  b.glass = make_glass(m, table, cos_o, front);
  if (wears_clearcoat(b.clearcoat)) wear_clearcoat(b, table, cos_o);
  if (lets_through(b)) {
    float below;
    b.beyond_chance = max_component(b.beyond) * (1.0f - b.coat_albedo) / max(lobe_weights(b, below).x, 1e-12f);
  }
  return b;
}

/// Has a part that light from a point can be scattered by.
bool takes_light(IN(Bsdf) b) {
  return max_component(b.diffuse) > 0.0f || (has_lobe(b) && !is_mirror(b)) || takes_light_behind(b) || has_clearcoat_lobe(b.clearcoat);
}

/// Fresnel's reflectance of layer and metal where light meets a facet at this cosine.
Spectrum lobe_fresnel(IN(Bsdf) b, float cosine) {
  Spectrum f = b.metal + (Spectrum(b.metallic) - b.metal) * schlick_weight(cosine);
  float cos_t;
  if (b.layer > 0.0f) f += Spectrum(b.layer * fresnel_dielectric(min(cosine, 1.0f), b.coat_eta, cos_t));
  return f;
}


/// Lambert's 1 / pi, or rough diffuse: Oren and Nayar 1994 in Fujii's form, which is reciprocal and creates no energy.
float diffuse_shape(float roughness, vec3 wo, vec3 wi) {
  if ((features & feature_materials) == 0u || roughness == 0.0f) return 1.0f / pi;
  float s = dot(wo, wi) - wo.z * wi.z, t = s > 0.0f ? max(wo.z, wi.z) : 1.0f;
  return (1.0f + roughness * s / max(t, 1e-6f)) / (pi + (pi / 2.0f - 2.0f / 3.0f) * roughness);
}

/// What the layers let through to the base and from it, towards the eye and at this cosine.
float through_layers(IN(Bsdf) b, Vec2Array table, float cosine) {
  if (b.coat == 0.0f && !wears_clearcoat(b.clearcoat)) return 1.0f;
  return (1.0f - b.coat_albedo) * (1.0f - coat_albedo(b, table, cosine)) * b.base_scale;
}

/// f cos of the parts that are no mirrors, and the density of bsdf_sample for them.
Spectrum bsdf_evaluate(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 wi, vec3 chances, OUT(float) pdf) {
  pdf = 0.0f;
  Spectrum f = Spectrum(0.0f);
  if (is_rough(b.glass)) {
    f = evaluate_glass(b.glass, table, wo, wi, pdf);
    pdf *= chances.z;
  }
  if (lets_through(b) && wi.z < 0.0f) {
    pdf += chances.x * b.beyond_chance * -wi.z / pi;
    f += b.beyond * (through_layers(b, table, -wi.z) * -wi.z / pi);
  }
  if (wi.z <= 0.0f) return f;
  pdf += (lets_through(b) ? chances.x * (1.0f - b.beyond_chance) : chances.x) * wi.z / pi;
  if (max_component(b.diffuse) > 0.0f) f += b.diffuse * (through_layers(b, table, wi.z) * wi.z * diffuse_shape(b.diffuse_roughness, wo, wi));
  if (has_lobe(b) && !is_mirror(b)) {
    vec3 h = normalize(wo + wi);
    Spectrum lobe = lobe_fresnel(b, dot(wo, h)) * (ggx_distribution(h, b.alpha) * ggx_visibility(wo.z, wi.z, b.alpha) * wi.z);
    vec2 e_i = lobe_albedo(table, wi.z, b.roughness);
    float rest = max(1.0f - b.lobe_albedo.x - b.lobe_albedo.y, 0.0f) * max(1.0f - e_i.x - e_i.y, 0.0f);
    lobe += b.multiple * (rest * b.multiple_scale * wi.z / pi);
    f += wears_clearcoat(b.clearcoat) ? lobe * under_clearcoat(b.clearcoat, table, wi.z) : lobe;
    pdf += chances.y * ggx_reflection_pdf(wo, h, b.alpha);
  }
  if (has_clearcoat_lobe(b.clearcoat)) {
    float density;
    f += Spectrum(evaluate_clearcoat(b.clearcoat, table, wo, wi, density));
    pdf += b.clearcoat.chance * density;
  }
  return f;
}

// `choice` in [0,1) picks reflection or refraction. Radiance shrinks by eta squared as it leaves the denser side (Veach 1997, 5.2).
BsdfSample sample_smooth_glass(IN(Glass) g, vec3 wo, float choice) {
  BsdfSample s;
  float cos_t;
  float reflectance = glass_reflectance(g, wo.z, cos_t);
  s.pdf = 0.0f;
  s.delta = true;
  s.transmitted = choice >= reflectance;
  s.direction = s.transmitted ? vec3(-g.eta * xy(wo), -cos_t) : vec3(-xy(wo), wo.z);
  s.weight = s.transmitted ? g.tint * (g.eta * g.eta) : Spectrum(1.0f);
  if (!is_thin(g)) return s;
  Faces faces = sheet(reflectance, g.tint);
  s.transmitted = choice >= faces.chance;
  s.direction = vec3(-xy(wo), s.transmitted ? -wo.z : wo.z);
  s.weight = s.transmitted ? faces.through / (1.0f - faces.chance) : faces.reflected / faces.chance;
  return s;
}

/// By rough glass, whose density and value are those of all lobes.
BsdfSample sample_frosted(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, float choice) {
  GlassSample g = sample_rough_glass(b.glass, wo, u, choice);
  BsdfSample s = BsdfSample(g.direction, Spectrum(0.0f), 0.0f, false, g.transmitted);
  if (!g.valid) return s;
  Spectrum f = bsdf_evaluate(b, table, wo, s.direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}

/// By a GGX lobe, which is no mirror, or by the base.
BsdfSample sample_opaque(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, bool lobe, float alpha) {
  BsdfSample s = BsdfSample(vec3(0.0f), Spectrum(0.0f), 0.0f, false, false);
  vec3 mirrored = reflect(-wo, sample_visible_normal(wo, alpha, u)), diffuse = sample_cosine(u);
  s.direction = vec3(lobe ? mirrored.x : diffuse.x, lobe ? mirrored.y : diffuse.y, lobe ? mirrored.z : diffuse.z);
  if (takes_light_behind(b) && s.direction.z <= 0.0f) return s;  // mirrored into the surface: not the light beyond
  Spectrum f = bsdf_evaluate(b, table, wo, s.direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}

/// By the base, to the other side.
BsdfSample sample_beyond(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u) {
  vec3 up = sample_cosine(u);
  BsdfSample s = BsdfSample(vec3(xy(up), -up.z), Spectrum(0.0f), 0.0f, false, true);
  Spectrum f = bsdf_evaluate(b, table, wo, s.direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}

BsdfSample sample_clearcoat(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u) {
  if (has_clearcoat_lobe(b.clearcoat)) return sample_opaque(b, table, wo, chances, u, true, b.clearcoat.alpha);
  Spectrum weight = Spectrum(clearcoat_mirror(b.clearcoat, wo.z) / b.clearcoat.chance);
  return BsdfSample(vec3(-xy(wo), wo.z), weight, 0.0f, true, false);
}

/// Where choice is beyond all chances, by the clear coat.
BsdfSample bsdf_sample(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, float choice) {
  BsdfSample s = BsdfSample(vec3(0.0f, 0.0f, 1.0f), Spectrum(0.0f), 0.0f, false, false);
  if (choice < chances.z) {
    if (is_rough(b.glass)) return sample_frosted(b, table, wo, chances, u, choice / chances.z);
    s = sample_smooth_glass(b.glass, wo, choice / chances.z);
    s.weight *= b.glass.share / chances.z;
    return s;
  }
  bool lobe = choice < chances.z + chances.y;
  if (lobe && is_mirror(b)) {
    s.direction = vec3(-xy(wo), wo.z);
    s.weight = lobe_fresnel(b, wo.z) / chances.y;
    if (wears_clearcoat(b.clearcoat)) s.weight *= 1.0f - b.clearcoat.albedo;
    s.delta = true;
    return s;
  }
  bool beyond = choice >= chances.z + chances.y + chances.x;
  if (!lobe && beyond && wears_clearcoat(b.clearcoat)) return sample_clearcoat(b, table, wo, chances, u);
  if (!lobe && chances.x == 0.0f) return s;
  if (!lobe && lets_through(b) && choice < chances.z + chances.y + chances.x * b.beyond_chance) return sample_beyond(b, table, wo, chances, u);
  return sample_opaque(b, table, wo, chances, u, lobe, b.alpha);
}
#endif
