// SPDX-License-Identifier: Apache-2.0
// glTF 2.0's material as one BSDF in the shading frame (z on the viewer's side): diffuse base, GGX lobes of layer and metal, glass.
// A dielectric's layer reflects as Fresnel says of its index, times specular. Its base gets and gives what the layer lets through,
// (1 - E(wo)) (1 - E(wi)) / (1 - mean of E) with the layer's directional albedo E: reciprocal, and a white base loses nothing (Kelemen and
// Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model", 2001). Both sides of a surface wear the layer. A glass share
// (transmission) is in lib/glass.glsl, a coat over all else in lib/clearcoat.glsl, fibres under it in lib/sheen.glsl, thin films in lib/thin_film.glsl. What the base lets through (diffuse_transmission) passes the layers of both
// sides, as what it gives back passes one twice. Light that meets several microfacets comes back as one more diffuse lobe (Kulla and Conty, "Revisiting
// Physically Based Shading at Imageworks", 2017).
#ifndef KUAFU_BSDF_GLSL
#define KUAFU_BSDF_GLSL
#include "lib/albedo_table.glsl"
#include "lib/clearcoat.glsl"
#include "lib/dispersion.glsl"
#include "lib/thin_film.glsl"
#include "lib/glass.glsl"
#include "lib/material.glsl"
#include "lib/microfacet.glsl"
#include "lib/sheen.glsl"

/// A film, and what it does over the dielectric layer.
struct LayerThinFilm {
  ThinFilm film;
  float eta, base;  // of the layer: 1 / index, and what it reflects at normal incidence without the film
  vec4 at;          // what both reflect: the largest channel, at cosines of 1/4, 1/2, 3/4 and 1
  float mean;       // over the hemisphere
};

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
  vec2 alphas;                  // along x and y; where they differ, roughness and alpha are those of a round lobe that gives about as much
  LayerThinFilm thin_film;
  Spectrum metal_base;          // what metal reflects at normal incidence without the film
  Spectrum multiple;            // of light that met several facets: share of 1 - E that comes back
  float multiple_scale;         // 1 / (1 - mean of E)
  float diffuse_roughness;
  float subsurface;             // share that goes below the surface
  Spectrum beyond;              // albedo of the base for light that leaves on the other side
  float beyond_chance;          // of that, where the base is taken
  Glass glass;
  Clearcoat clearcoat;
  Sheen sheen;
};

struct BsdfSample {
  vec3 direction;
  Spectrum weight;  // f cos / pdf
  float pdf;        // of all lobes that are no mirrors; 0 with delta
  bool delta, transmitted;
};

// Small functions take what they need of a Bsdf: drivers that inline calls first copy a struct for each.
bool is_drawn_out(vec2 alphas) { return (features & feature_anisotropy) != 0u && alphas.x != alphas.y; }

/// The cosine at which the round lobe of b.alpha hides as much of itself as a lobe that is drawn out does towards w.
float lobe_cosine(vec2 alphas, float alpha, vec3 w) {
  float cosine = abs(w.z);
  if (!is_drawn_out(alphas)) return cosine;
  vec2 hidden = vec2(w.x * alphas.x, w.y * alphas.y) / alpha;
  return cosine * inversesqrt(max(cosine * cosine + dot(hidden, hidden), 1e-12f));
}

/// What the film makes of the layer's albedo: smooth facets reflect as it does at this cosine, rough ones as it does in the mean, and more at grazing angles.
float thin_film_over_layer(IN(LayerThinFilm) f, Vec2Array table, float roughness, float cosine, float albedo) {
  float cos_t, bare = fresnel_dielectric(clamp(cosine, 1e-3f, 1.0f), f.eta, cos_t), p = clamp(cosine, 0.0f, 1.0f) * 4.0f;
  int c = min(int(p), 3);
  float smooth_one = albedo * mix(c == 0 ? 1.0f : f.at[c - 1], f.at[c], p - float(c)) / max(bare, 1e-4f);
  vec2 facets = lobe_albedo(table, cosine, roughness);
  float rough_one = facets.x * f.mean + facets.y + max(1.0f - facets.x - facets.y, 0.0f) * f.mean * f.mean;
  float filmed = mix(smooth_one, max(smooth_one, rough_one), min(3.0f * roughness, 1.0f));
  return min(mix(albedo, filmed, f.film.weight), 1.0f);
}

/// Share of light that the layer reflects, single and multiple scattering.
float layer_albedo(IN(Bsdf) b, Vec2Array table, float cosine) {
  float albedo = albedo_of_layer(b.layer_rows, table, cosine);
  return wears_thin_film(b.thin_film.film) ? thin_film_over_layer(b.thin_film, table, b.roughness, cosine, albedo) : albedo;
}

/// The same towards w of a layer that is drawn out: facets that tilt in the plane of w and the normal say what is seen of it, and those that
/// tilt out of that plane, the wider they do, that it is more like the round one's. Within 0.04 of quadratures.
float layer_albedo_towards(IN(Bsdf) b, Vec2Array table, vec3 w) {
  float cosine = abs(w.z), round_one = layer_albedo(b, table, cosine), s2 = dot(xy(w), xy(w));
  if (!is_drawn_out(b.alphas) || s2 < 1e-6f) return round_one;
  float in_plane = length(vec2(w.x * b.alphas.x, w.y * b.alphas.y)) * inversesqrt(s2);
  float out_of_it = length(vec2(w.y * b.alphas.x, w.x * b.alphas.y)) * inversesqrt(s2);
  float seen = albedo_of_layer(find_layer_rows(1.0f / b.coat_eta, sqrt(in_plane)), table, cosine);
  if (wears_thin_film(b.thin_film.film)) seen = thin_film_over_layer(b.thin_film, table, b.roughness, cosine, seen);
  return mix(round_one, seen, 1.0f - 0.5f * out_of_it * out_of_it);
}

/// Its mean over the hemisphere; with a film by Gauss's rule of three points.
float layer_albedo_mean(IN(Bsdf) b, Vec2Array table) {
  if (!wears_thin_film(b.thin_film.film)) return mean_of_layer(b.layer_rows, table);
  float sum = 0.0f;
  for (int i = 0; i < 3; ++i) sum += gauss_weight(i) * layer_albedo(b, table, gauss_cosine(i));
  return sum;
}

/// What all layers over a dielectric's base reflect.
float coat_albedo(IN(Bsdf) b, Vec2Array table, vec3 w) {
  float layer = b.coat == 0.0f ? 0.0f : b.coat * layer_albedo_towards(b, table, w);
  if (!wears_clearcoat(b.clearcoat)) return layer;
  float over = clearcoat_albedo(b.clearcoat, table, clearcoat_cosine(b.clearcoat, w));
  return over + (1.0f - over) * layer;
}

/// Mean over the hemisphere of what a clear coat and the layer below it reflect together: their product by Gauss's rule of three points.
float clearcoat_and_layer_mean(IN(Bsdf) b, Vec2Array table) {
  float over = clearcoat_mean(b.clearcoat, table);
  if (b.coat == 0.0f) return over;
  float layer = b.coat * layer_albedo_mean(b, table);
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

/// Light that the base scatters is chosen between its parts.
bool base_has_parts(IN(Bsdf) b) { return lets_through(b) || wears_sheen(b.sheen); }

/// What several facets scatter. Means of Fresnel's reflectance: Schlick's exactly, the layer's by Kulla and Conty's fit.
void set_multiple(INOUT(Bsdf) b, IN(MaterialPoint) m, Vec2Array table) {
  float mean = lobe_mean(table, b.roughness), layer_mean = (m.ior - 1.0f) / (4.08567f + 1.00071f * m.ior);
  Spectrum metal_mean = m.base + (Spectrum(1.0f) - m.base) * (1.0f / 21.0f);
  if (wears_thin_film(b.thin_film.film)) {
    metal_mean += (thin_film_mean(b.thin_film.film, b.metal_base) - metal_mean) * b.thin_film.film.weight;
    layer_mean += (b.thin_film.mean - layer_mean) * b.thin_film.film.weight;
  }
  b.multiple = multiple_share(metal_mean, mean) * b.metallic;
  b.multiple += Spectrum(b.layer * (layer_mean * layer_mean * mean / (1.0f - layer_mean * (1.0f - mean))));
  b.multiple_scale = 1.0f / max(1.0f - mean, 1e-4f);
}

/// What sheen leaves towards the viewer.
float left_by_sheen(IN(Sheen) s) { return wears_sheen(s) ? 1.0f - s.taken : 1.0f; }

/// What all that lies over the base leaves towards the viewer.
float left_for_base(float coat_albedo, IN(Sheen) s) { return wears_sheen(s) ? (1.0f - coat_albedo) * left_by_sheen(s) : 1.0f - coat_albedo; }

/// What fibres give towards the viewer.
float sheen_weight(IN(Sheen) s, IN(Clearcoat) c) { return s.share * s.taken * (wears_clearcoat(c) ? 1.0f - c.albedo : 1.0f); }

/// What the base with fibres and several facets, the GGX lobe and the glass give towards the viewer; below: what goes below the surface.
vec3 lobe_weights(IN(Bsdf) b, OUT(float) below) {
  vec3 w = vec3(max_component(b.diffuse) * left_for_base(b.coat_albedo, b.sheen), 0.0f, b.glass.share);
  if (has_lobe(b)) {
    float under = wears_clearcoat(b.clearcoat) ? 1.0f - b.clearcoat.albedo : 1.0f;
    if (wears_sheen(b.sheen)) under *= left_by_sheen(b.sheen);
    w.y = dot(b.lobe_albedo, vec2(max_component(b.metal), b.metallic)) * under;
    if (wears_thin_film(b.thin_film.film)) w.y += b.thin_film.film.weight * b.metallic * (b.lobe_albedo.x + b.lobe_albedo.y) * under;
    if (b.layer > 0.0f) w.y += b.layer / b.coat * (wears_clearcoat(b.clearcoat) ? b.coat_albedo - b.clearcoat.albedo : b.coat_albedo);
    w.x += max_component(b.multiple) * max(1.0f - b.lobe_albedo.x - b.lobe_albedo.y, 0.0f) * under;
  }
  if (lets_through(b)) w.x += max_component(b.beyond) * left_for_base(b.coat_albedo, b.sheen);
  if (wears_sheen(b.sheen)) w.x += sheen_weight(b.sheen, b.clearcoat);
  below = (features & feature_subsurface) != 0u ? b.subsurface * left_for_base(b.coat_albedo, b.sheen) : 0.0f;
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

void wear_clearcoat(INOUT(Bsdf) b, Vec2Array table, vec3 wo) {
  float below, over = b.clearcoat.share * b.clearcoat.albedo;
  b.coat_albedo = coat_albedo(b, table, wo);
  b.base_scale = 1.0f / (1.0f - min(clearcoat_and_layer_mean(b, table), 0.9999f));
  vec3 w = lobe_weights(b, below);
  b.clearcoat.chance = over / (over + w.x + w.y + w.z + below);
}

/// Alphas by KHR_materials_anisotropy; the mean of their powers is found by quadratures of such lobes' albedos, where white metal gains 1.3 % at most.
void draw_out(INOUT(Bsdf) b, float anisotropy) {
  float across = max(b.alpha, mirror_alpha), along = mix(across, 1.0f, anisotropy * anisotropy);
  b.alphas = vec2(along, across);
  b.alpha = pow(0.5f * (along * sqrt(along) + across * sqrt(across)), 2.0f / 3.0f);
  b.roughness = sqrt(b.alpha);
}

Bsdf make_bsdf(IN(MaterialPoint) m, Vec2Array table, vec3 wo, bool front) {
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
  b.alphas = vec2(b.alpha);
  if ((features & feature_anisotropy) != 0u && m.anisotropy > 0.0f) draw_out(b, m.anisotropy);
  b.thin_film = LayerThinFilm(thin_film_of(m.iridescence, m.iridescence_ior, m.thin_film_nm), b.coat_eta, 0.0f, vec4(0.0f), 0.0f);
  b.metal_base = m.base;
  if (wears_thin_film(b.thin_film.film)) {
    b.thin_film.base = (m.ior - 1.0f) * (m.ior - 1.0f) / ((m.ior + 1.0f) * (m.ior + 1.0f));
    for (int i = 0; i < 4; ++i) b.thin_film.at[i] = max_component(thin_film_over(thin_film_waves(b.thin_film.film, 0.25f * float(i + 1)), Spectrum(b.thin_film.base)));
    b.thin_film.mean = (b.thin_film.at.x + 2.0f * b.thin_film.at.y + 3.0f * b.thin_film.at.z + 2.0f * b.thin_film.at.w) / 8.0f;
  }
  b.multiple = Spectrum(0.0f);
  b.multiple_scale = 0.0f;
  b.lobe_albedo = vec2(0.0f);
  if (has_lobe(b)) {
    b.lobe_albedo = lobe_albedo(table, lobe_cosine(b.alphas, b.alpha, wo), b.roughness);
    if (!is_mirror(b)) set_multiple(b, m, table);
  }
  b.clearcoat = make_clearcoat(m, table, wo, 1.0f - (1.0f - m.metallic) * m.transmission);
  b.sheen = make_sheen(m, table, wo.z, 1.0f - (1.0f - m.metallic) * m.transmission);
  b.coat_albedo = 0.0f;
  b.base_scale = 1.0f;
  b.layer_rows = AlbedoRows(0, 0, 0.0f, 0.0f);
  if (b.layer > 0.0f) {
    b.layer_rows = find_layer_rows(m.ior, b.roughness);
    b.coat_albedo = coat_albedo(b, table, wo);
    b.base_scale = 1.0f / (1.0f - b.coat * min(layer_albedo_mean(b, table), 0.9999f));
  }
  b.diffuse_roughness = (features & feature_materials) != 0u ? m.diffuse_roughness : 0.0f;
  b.glass = make_glass(m, table, wo.z, front);
  if (wears_clearcoat(b.clearcoat)) wear_clearcoat(b, table, wo);
  if (lets_through(b) || wears_sheen(b.sheen)) {
    float below, of_base = max(lobe_weights(b, below).x, 1e-12f);
    b.beyond_chance = max_component(b.beyond) * left_for_base(b.coat_albedo, b.sheen) / of_base;
    b.sheen.chance = wears_sheen(b.sheen) ? sheen_weight(b.sheen, b.clearcoat) / of_base : 0.0f;
  }
  return b;
}

/// Has a part that light from a point can be scattered by.
bool takes_light(IN(Bsdf) b) {
  return max_component(b.diffuse) > 0.0f || (has_lobe(b) && !is_mirror(b)) || takes_light_behind(b) || has_clearcoat_lobe(b.clearcoat) ||
         wears_sheen(b.sheen);
}

/// Fresnel's reflectance of metal, and of a share of a layer, where light meets a facet at this cosine.
Spectrum plain_fresnel(Spectrum metal, float metallic, float layer, float layer_eta, float cosine) {
  Spectrum f = metal + (Spectrum(metallic) - metal) * schlick_weight(cosine);
  float cos_t;
  if (layer > 0.0f) f += Spectrum(layer * fresnel_dielectric(min(cosine, 1.0f), layer_eta, cos_t));
  return f;
}

/// That of the lobe.
Spectrum lobe_fresnel(IN(Bsdf) b, float cosine) {
  Spectrum f = plain_fresnel(b.metal, b.metallic, b.layer, b.coat_eta, cosine);
  if (!wears_thin_film(b.thin_film.film)) return f;
  ThinFilmWaves waves = thin_film_waves(b.thin_film.film, cosine);
  Spectrum filmed = thin_film_over(waves, b.metal_base) * b.metallic + thin_film_over(waves, Spectrum(b.thin_film.base)) * b.layer;
  return f + (filmed - f) * b.thin_film.film.weight;
}

/// Lambert's 1 / pi, or rough diffuse: Oren and Nayar 1994 in Fujii's form, which is reciprocal and creates no energy.
float diffuse_shape(float roughness, vec3 wo, vec3 wi) {
  if ((features & feature_materials) == 0u || roughness == 0.0f) return 1.0f / pi;
  float s = dot(wo, wi) - wo.z * wi.z, t = s > 0.0f ? max(wo.z, wi.z) : 1.0f;
  return (1.0f + roughness * s / max(t, 1e-6f)) / (pi + (pi / 2.0f - 2.0f / 3.0f) * roughness);
}

/// What the layers let through to the base and from it, towards the viewer and towards w.
float through_layers(IN(Bsdf) b, Vec2Array table, vec3 w) {
  float left = wears_sheen(b.sheen) ? under_sheen(b.sheen, table, abs(w.z)) : 1.0f;
  if (b.coat == 0.0f && !wears_clearcoat(b.clearcoat)) return left;
  float through = (1.0f - b.coat_albedo) * (1.0f - coat_albedo(b, table, w)) * b.base_scale;
  return wears_sheen(b.sheen) ? through * left : through;
}

/// Distribution times visibility of the GGX lobe, and the density of its facets' samples.
float lobe_facets(vec2 alphas, float alpha, vec3 wo, vec3 wi, vec3 h, OUT(float) pdf) {
  if (is_drawn_out(alphas)) {
    pdf = ggx_reflection_pdf_along(wo, h, alphas);
    return ggx_distribution_along(h, alphas) * ggx_visibility_along(wo, wi, alphas);
  }
  pdf = ggx_reflection_pdf(wo, h, alpha);
  return ggx_distribution(h, alpha) * ggx_visibility(wo.z, wi.z, alpha);
}

/// f cos of the parts that are no mirrors, and the density of bsdf_sample for them.
Spectrum bsdf_evaluate(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 wi, vec3 chances, OUT(float) pdf) {
  pdf = 0.0f;
  Spectrum f = Spectrum(0.0f);
  if (is_rough(b.glass)) {
    f = evaluate_glass(b.glass, table, wo, wi, pdf);
    pdf *= chances.z;
  }
  bool base = max_component(b.diffuse) > 0.0f;
  float through = 0.0f;
  if (base || lets_through(b)) through = through_layers(b, table, wi);
  if (lets_through(b) && wi.z < 0.0f) {
    pdf += chances.x * b.beyond_chance * -wi.z / pi;
    f += b.beyond * (through * -wi.z / pi);
  }
  if (wi.z <= 0.0f) return f;
  float base_chance = lets_through(b) ? chances.x * (1.0f - b.beyond_chance) : chances.x;
  if (wears_sheen(b.sheen)) base_chance -= chances.x * b.sheen.chance;
  pdf += base_chance * wi.z / pi;
  if (base) f += b.diffuse * (through * wi.z * diffuse_shape(b.diffuse_roughness, wo, wi));
  if (has_lobe(b) && !is_mirror(b)) {
    vec3 h = normalize(wo + wi);
    float density;
    Spectrum lobe = lobe_fresnel(b, dot(wo, h)) * (lobe_facets(b.alphas, b.alpha, wo, wi, h, density) * wi.z);
    vec2 e_i = lobe_albedo(table, lobe_cosine(b.alphas, b.alpha, wi), b.roughness);
    float rest = max(1.0f - b.lobe_albedo.x - b.lobe_albedo.y, 0.0f) * max(1.0f - e_i.x - e_i.y, 0.0f);
    lobe += b.multiple * (rest * b.multiple_scale * wi.z / pi);
    if (wears_sheen(b.sheen)) lobe *= under_sheen(b.sheen, table, wi.z);
    f += wears_clearcoat(b.clearcoat) ? lobe * under_clearcoat(b.clearcoat, table, wi) : lobe;
    pdf += chances.y * density;
  }
  if (wears_sheen(b.sheen)) {
    f += evaluate_sheen(b.sheen, table, wo, wi) * (wears_clearcoat(b.clearcoat) ? under_clearcoat(b.clearcoat, table, wi) : 1.0f);
    pdf += chances.x * b.sheen.chance / (2.0f * pi);
  }
  if (has_clearcoat_lobe(b.clearcoat)) {
    float density;
    f += Spectrum(evaluate_clearcoat(b.clearcoat, table, wo, wi, density));
    pdf += b.clearcoat.chance * density;
  }
  return f;
}

/// By glass whose channels differ (lib/dispersion.glsl).
BsdfSample sample_unlike_channels(IN(Glass) g, vec3 wo, float choice) {
  Spectrum reflected = reflected_channels(g, wo.z);
  float chance = mean_by(g.carries, reflected);
  BsdfSample s = BsdfSample(vec3(-xy(wo), wo.z), reflected / max(chance, 1e-12f), 0.0f, true, false);
  if (choice < chance) return s;
  float cos_t, per_chance = 1.0f / (1.0f - chance);
  s.transmitted = true;
  if (parts_colors(g.dispersion, g.thin)) {
    Refraction r = refract_channel(g, wo, reflected, (choice - chance) * per_chance);
    s.direction = r.direction;
    s.weight = r.weight * per_chance;
    return s;
  }
  fresnel_dielectric(wo.z, g.eta, cos_t);
  s.direction = vec3(-g.eta * xy(wo), -cos_t);
  s.weight = g.tint * (Spectrum(1.0f) - reflected) * (g.eta * g.eta * per_chance);
  return s;
}

// `choice` in [0,1) picks reflection or refraction. Radiance shrinks by eta squared as it leaves the denser side (Veach 1997, 5.2).
BsdfSample sample_smooth_glass(IN(Glass) g, vec3 wo, float choice) {
  if (!is_thin(g) && (wears_thin_film(g.thin_film) || parts_colors(g.dispersion, g.thin))) return sample_unlike_channels(g, wo, choice);
  BsdfSample s;
  float cos_t;
  float reflectance = glass_reflectance(g, wo.z, cos_t);
  s.pdf = 0.0f;
  s.delta = true;
  s.transmitted = choice >= reflectance;
  s.direction = s.transmitted ? vec3(-g.eta * xy(wo), -cos_t) : vec3(-xy(wo), wo.z);
  s.weight = s.transmitted ? g.tint * (g.eta * g.eta) : Spectrum(1.0f);
  if (!is_thin(g)) return s;
  Faces faces = sheet(under_thin_film(g.thin_film, g.eta, g.specular, reflectance, wo.z), g.tint);
  s.transmitted = choice >= faces.chance;
  s.direction = vec3(-xy(wo), s.transmitted ? -wo.z : wo.z);
  s.weight = s.transmitted ? faces.through / (1.0f - faces.chance) : faces.reflected / faces.chance;
  return s;
}

/// Towards a direction that one of the lobes drew; its density and value are those of all lobes.
BsdfSample sample_towards(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec3 direction, bool transmitted) {
  BsdfSample s = BsdfSample(direction, Spectrum(0.0f), 0.0f, false, transmitted);
  if (!transmitted && takes_light_behind(b) && direction.z <= 0.0f) return s;  // mirrored into the surface: not the light beyond
  Spectrum f = bsdf_evaluate(b, table, wo, direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}

/// By a GGX lobe, which is no mirror, or by the base.
BsdfSample sample_opaque(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, bool lobe) {
  vec3 mirrored = reflect(-wo, sample_visible_normal(wo, b.alpha, u)), diffuse = sample_cosine(u);
  vec3 direction = vec3(lobe ? mirrored.x : diffuse.x, lobe ? mirrored.y : diffuse.y, lobe ? mirrored.z : diffuse.z);
  return sample_towards(b, table, wo, chances, direction, false);
}

/// By a mirror: the GGX lobe's or the clear coat's.
BsdfSample sample_mirror(IN(Bsdf) b, vec3 wo, vec3 chances, bool lobe) {
  BsdfSample s = BsdfSample(vec3(-xy(wo), wo.z), Spectrum(0.0f), 0.0f, true, false);
  if (!lobe) {
    s.direction = reflect(-wo, b.clearcoat.normal);
    s.weight = Spectrum(clearcoat_mirror(b.clearcoat, wo) / b.clearcoat.chance);
    return s;
  }
  s.weight = lobe_fresnel(b, wo.z) / chances.y;
  if (wears_clearcoat(b.clearcoat)) s.weight *= 1.0f - b.clearcoat.albedo;
  if (wears_sheen(b.sheen)) s.weight *= left_by_sheen(b.sheen);
  return s;
}

/// A direction by the base: through it, by fibres, or by the cosine; `choice` counts from the base's first chance.
vec3 sample_base(IN(Bsdf) b, vec3 chances, vec2 u, float choice, OUT(bool) transmitted) {
  float beyond = lets_through(b) ? chances.x * b.beyond_chance : 0.0f;
  transmitted = choice < beyond;
  if (wears_sheen(b.sheen) && !transmitted && choice - beyond < chances.x * b.sheen.chance) return sample_hemisphere(u);
  vec3 up = sample_cosine(u);
  return transmitted ? vec3(xy(up), -up.z) : up;
}

/// Where choice is beyond all chances, by the clear coat.
BsdfSample bsdf_sample(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, float choice) {
  BsdfSample none_sampled = BsdfSample(vec3(0.0f, 0.0f, 1.0f), Spectrum(0.0f), 0.0f, false, false);
  if (choice < chances.z && !is_rough(b.glass)) {
    BsdfSample s = sample_smooth_glass(b.glass, wo, choice / chances.z);
    s.weight *= b.glass.share / chances.z;
    return s;
  }
  bool glass = choice < chances.z, lobe = !glass && choice < chances.z + chances.y;
  bool over = !glass && !lobe && choice >= chances.z + chances.y + chances.x && wears_clearcoat(b.clearcoat);
  if ((lobe && is_mirror(b)) || (over && !has_clearcoat_lobe(b.clearcoat))) return sample_mirror(b, wo, chances, lobe);
  vec3 direction;
  bool transmitted = false;
  if (glass) {
    GlassSample g = sample_rough_glass(b.glass, wo, u, choice / chances.z);
    none_sampled.transmitted = g.transmitted;
    if (!g.valid) return none_sampled;
    direction = g.direction;
    transmitted = g.transmitted;
  } else if (lobe && is_drawn_out(b.alphas)) {
    direction = reflect(-wo, sample_visible_normal_along(wo, b.alphas, u));
  } else if (over) {
    direction = sample_clearcoat(b.clearcoat, wo, u);
  } else if (lobe) {
    direction = reflect(-wo, sample_visible_normal(wo, b.alpha, u));
  } else {
    if (chances.x == 0.0f) return none_sampled;
    direction = sample_base(b, chances, u, choice - chances.z - chances.y, transmitted);
  }
  return sample_towards(b, table, wo, chances, direction, transmitted);
}
#endif
