// SPDX-License-Identifier: Apache-2.0
// Glass: Fresnel's reflectance from its side, and a roughness of its own (Walter et al. 2007). It bounds a body, or is a sheet (thin): both of
// its faces at once, with all reflections between them, and nothing bends. Light that meets several facets leaves on both sides (Kulla and
// Conty 2017), so that none is lost: a sheet's as diffuse lobes; a body's turned forwards, and by lobes that are fitted to random walks over
// facets (Heitz et al., "Multiple-Scattering Microfacet BSDFs with the Smith Model", 2016). From inside, what goes through follows by
// reciprocity.
#ifndef KUAFU_GLASS_GLSL
#define KUAFU_GLASS_GLSL
#include "lib/albedo_table.glsl"
#include "lib/thin_film.glsl"
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

const int glass_cosines = int(glass_albedo_cosines), glass_row_size = 2 * glass_cosines + 4;

/// What faces give and let through, and the chance of taking what they reflect.
struct Faces {
  Spectrum reflected, through;
  float chance;
};

struct Glass {
  float share;  // of the surface
  float alpha;
  float eta;  // n_viewer / n_other
  float specular;
  Spectrum tint;
  bool thin;
  float roughness;   // what follows is of rough glass
  float albedo;      // of one facet, towards the viewer
  Faces several;     // facets: of the rest of the light
  vec2 stays;        // share of the rest that stays on its side, x + y cosine: for the viewer's side,
  vec2 stays_beyond; // and for the other
  vec2 rest_scale;   // 1 / mean of what several facets give, on the viewer's side and beyond
  float forward;     // how much that is turned forwards: 0 evenly, 1 all of it where both directions graze
  AlbedoRows rows;
  ThinFilm thin_film;
  float dispersion;  // of smooth glass that bounds a body, and
  Spectrum carries;  // MaterialPoint.carries
};

struct GlassSample {
  vec3 direction;
  bool transmitted, valid;
};

bool is_thin(IN(Glass) g) { return (features & feature_materials) != 0u && g.thin; }

/// Alpha of the glass. An index that bends nothing has no facets to be seen: its half vectors vanish, and rays go straight on.
float glass_alpha(IN(MaterialPoint) m) { return m.ior < 1.001f ? 0.0f : m.transmission_roughness * m.transmission_roughness; }

/// Both faces of a sheet that reflect `r` each, with all reflections between them; light is tinted each time it crosses the sheet.
Faces sheet(Spectrum r, Spectrum tint) {
  Faces f;
  f.through = tint * ((Spectrum(1.0f) - r) * (Spectrum(1.0f) - r)) / max(Spectrum(1.0f) - tint * tint * (r * r), Spectrum(1e-12f));
  f.reflected = r + f.through * tint * r;
  float reflected = max_component(f.reflected), sum = reflected + max_component(f.through);
  f.chance = sum > 0.0f ? reflected / sum : 0.0f;
  return f;
}

float glass_reflectance(IN(Glass) g, float cosine, OUT(float) cos_t) {
  float reflectance = fresnel_dielectric(cosine, g.eta, cos_t);
  return cos_t > 0.0f ? reflectance * g.specular : reflectance;
}

ThinFilm thin_film_of(float weight, float ior, float thickness_nm) { return ThinFilm(thickness_nm > 0.0f ? weight : 0.0f, ior, thickness_nm); }

/// A reflectance, without a film, with what the film makes of it; `outside`: the cosine on the side of the smaller index.
Spectrum under_thin_film(IN(ThinFilm) f, float eta, float specular, float reflectance, float outside) {
  if (!wears_thin_film(f)) return Spectrum(reflectance);
  float root = (1.0f - eta) / (1.0f + eta);
  return Spectrum(reflectance * (1.0f - f.weight)) + thin_film_reflectance(f, Spectrum(root * root), outside) * (f.weight * specular);
}

/// glass_reflectance with the film.
Spectrum filmed_reflectance(IN(Glass) g, float cosine, OUT(float) cos_t) {
  float reflectance = glass_reflectance(g, cosine, cos_t);
  if (cos_t == 0.0f) return Spectrum(reflectance);
  return under_thin_film(g.thin_film, g.eta, g.specular, reflectance, g.eta > 1.0f ? cos_t : cosine);
}

/// At a facet that light meets at this cosine. Energies: radiance that goes through changes by eta squared besides (Veach 1997, 5.2).
Faces faces_at(IN(Glass) g, float cosine, OUT(float) cos_t) {
  Spectrum r = filmed_reflectance(g, min(cosine, 1.0f), cos_t);
  if (g.thin) return sheet(r, g.tint);
  Faces f;
  f.reflected = r;
  f.through = g.tint * (Spectrum(1.0f) - r);
  f.chance = wears_thin_film(g.thin_film) ? mean_component(r) : channel_of(r, 0u);
  return f;
}

/// Albedos of one facet, outside and inside; they are linear in specular.
vec2 facet_albedo(IN(Glass) g, Vec2Array table, int c) {
  vec2 e = rows_entry(g.rows, table, c, glass_row_size);
  if (g.specular == 1.0f) return e;
  return mix(rows_entry(g.rows, table, c + glass_cosines + 2, glass_row_size), e, g.specular);
}

/// Albedo of one facet from the viewer's side, or from beyond.
float facet_albedo_from(IN(Glass) g, Vec2Array table, float cosine, bool beyond) {
  if (g.thin) {
    vec2 lossless = lobe_albedo(table, cosine, g.roughness);
    return min(lossless.x + lossless.y, 1.0f);
  }
  float p = sqrt(clamp(cosine, 0.0f, 1.0f)) * float(glass_cosines - 1);
  int c = table_cell(p, glass_cosines);
  vec2 e = mix(facet_albedo(g, table, c), facet_albedo(g, table, c + 1), p - float(c));
  return clamp(beyond == (g.eta > 1.0f) ? e.x : e.y, 0.0f, 1.0f);
}

// Mean of Fresnel's reflectance from outside over the hemisphere: Kulla and Conty's fit.
float mean_reflectance(IN(Glass) g) {
  float ior = max(g.eta, 1.0f / g.eta);
  return g.specular * (ior - 1.0f) / (4.08567f + 1.00071f * ior);
}

void set_several_of_sheet(INOUT(Glass) g, Vec2Array table) {
  float mean = lobe_mean(table, g.roughness);
  g.several = sheet(Spectrum(mean_reflectance(g)), g.tint);
  Spectrum left = g.several.reflected + g.several.through;  // after each facet
  Spectrum scale = left * mean / (Spectrum(1.0f) - left * (1.0f - mean));
  g.several.reflected *= scale;
  g.several.through *= scale;
  g.rest_scale = vec2(1.0f / max(1.0f - mean, 1e-4f));
}

// Fitted to walks at indices from 1.1 to 2.4 and roughnesses from 0.3 to 1. Of the rest from outside, the share that stays outside does not
// depend on the direction; from inside, the share that leaves is even where facets are smooth, and like the cosine where they are rough.
void set_several_of_body(INOUT(Glass) g, Vec2Array table) {
  bool inside = g.eta > 1.0f;
  float r = g.roughness, ior = max(g.eta, 1.0f / g.eta), odds = 0.15f * mean_reflectance(g) / (r * r * r);
  vec2 rest = max(vec2(1.0f) - facet_albedo(g, table, glass_cosines), vec2(1e-5f));  // means, outside and inside
  float inclined = max(2.0f / 3.0f - facet_albedo(g, table, glass_cosines + 1).y, 1e-5f);  // of rest times cosine, inside
  float leaving = (1.0f - r) * rest.y + r * inclined, through = min(rest.x / (1.0f + odds), ior * ior * leaving);
  float leaves = through / (ior * ior * leaving);
  vec2 outside_stays = vec2(1.0f - through / rest.x, 0.0f);
  vec2 inside_stays = vec2(1.0f - leaves * (1.0f - r), -leaves * r);
  vec2 reflected = 1.0f / max(vec2(rest.x - through, rest.y - leaves * leaving), vec2(1e-6f));
  g.stays = inside ? inside_stays : outside_stays;
  g.stays_beyond = inside ? outside_stays : inside_stays;
  g.rest_scale = inside ? vec2(reflected.y, 1.0f / through) : vec2(reflected.x, 1.0f / (leaves * leaving));
  g.forward = min((2.25f - 1.1f * g.alpha * g.alpha) / (ior * ior), 0.97f);
}

Glass make_glass(IN(MaterialPoint) m, Vec2Array table, float cos_o, bool front) {
  Glass g = Glass((1.0f - m.metallic) * m.transmission, 0.0f, front ? 1.0f / m.ior : m.ior, m.specular, m.base, false, 0.0f, 0.0f,
                  Faces(Spectrum(0.0f), Spectrum(0.0f), 0.0f), vec2(0.0f), vec2(0.0f), vec2(0.0f), 0.0f, AlbedoRows(0, 0, 0.0f, 0.0f),
                  thin_film_of(m.iridescence, m.iridescence_ior, m.thin_film_nm), m.dispersion, m.carries);
  if ((features & feature_materials) == 0u) return g;
  g.alpha = glass_alpha(m);
  g.thin = m.thin_walled;
  if (g.thin) g.eta = 1.0f / m.ior;  // the viewer is outside of either face
  if (g.share == 0.0f || g.alpha < mirror_alpha) return g;
  g.roughness = m.transmission_roughness;
  g.rows = find_rows(sqrt((m.ior - 1.0f) / (m.ior + 1.0f)), int(glass_albedo_indices), g.roughness, int(glass_albedo_roughnesses), int(glass_albedo_first), glass_row_size);
  g.albedo = facet_albedo_from(g, table, cos_o, false);
  if (g.thin) {
    set_several_of_sheet(g, table);
    return g;
  }
  set_several_of_body(g, table);
  g.several.chance = g.stays.x + g.stays.y * cos_o;
  g.several.reflected = Spectrum(g.several.chance);
  g.several.through = g.tint * (1.0f - g.several.chance);
  return g;
}

bool is_rough(IN(Glass) g) { return (features & feature_materials) != 0u && g.share > 0.0f && g.alpha >= mirror_alpha; }

/// f cos of light that meets one facet, and the density of its sampler (Walter et al. 2007, eq. 20, 21). What goes through a sheet is what it would
/// reflect, turned to the other side.
Spectrum evaluate_facet(IN(Glass) g, vec3 wo, vec3 wi, OUT(float) pdf) {
  bool reflected = wi.z > 0.0f;
  pdf = 0.0f;
  vec3 to = vec3(xy(wi), g.thin ? abs(wi.z) : wi.z);
  vec3 h = normalize(reflected || g.thin ? wo + to : -(g.eta * wo + to));
  if (h.z < 0.0f) h = -h;
  float cos_t, o = dot(wo, h), i = dot(to, h);
  if (o <= 0.0f || (reflected || g.thin) != (i > 0.0f)) return Spectrum(0.0f);
  Faces faces = faces_at(g, o, cos_t);
  float visible = ggx_reflection_pdf(wo, h, g.alpha);
  float free = reflected || g.thin ? ggx_visibility(wo.z, abs(wi.z), g.alpha) : ggx_refraction_visibility(wo.z, abs(wi.z), g.alpha);
  float facets = ggx_distribution(h, g.alpha) * free * abs(wi.z);
  pdf = (reflected ? faces.chance : 1.0f - faces.chance) * visible;
  if (reflected) return faces.reflected * facets;
  if (g.thin) return faces.through * facets;
  float way = g.eta * o + i, turn = 4.0f * o * abs(i) / (way * way);  // of facet to direction, times the 4 o of reflection
  pdf *= turn;
  return faces.through * (facets * turn * g.eta * g.eta);
}

/// What of the light that meets several facets leaves at this cosine, over the cosine: of a mean of 1 over the hemisphere.
float several_towards(IN(Glass) g, Vec2Array table, float cosine, bool beyond) {
  float rest = (1.0f - facet_albedo_from(g, table, cosine, beyond)) * (beyond ? g.rest_scale.y : g.rest_scale.x);
  if (g.thin) return rest;
  return rest * (beyond ? 1.0f - g.stays_beyond.x - g.stays_beyond.y * cosine : g.stays.x + g.stays.y * cosine);
}

/// Density of the azimuth around the one that goes on straight, times 2 pi: a wrapped Cauchy distribution.
float forward_density(IN(Glass) g, vec3 wo, vec3 wi) {
  float sines = (1.0f - wo.z * wo.z) * (1.0f - wi.z * wi.z), spread = g.forward * g.forward * max(sines, 0.0f);
  return (1.0f - spread) / (1.0f + spread + 2.0f * g.forward * dot(xy(wo), xy(wi)));
}

/// f cos of rough glass, both sides, and the density of sample_rough_glass.
Spectrum evaluate_glass(IN(Glass) g, Vec2Array table, vec3 wo, vec3 wi, OUT(float) pdf) {
  Spectrum f = evaluate_facet(g, wo, wi, pdf);
  bool reflected = wi.z > 0.0f;
  float cosine = abs(wi.z), rest = (1.0f - g.albedo) * cosine / pi * forward_density(g, wo, wi);
  pdf = g.albedo * pdf + rest * (reflected ? g.several.chance : 1.0f - g.several.chance);
  rest *= several_towards(g, table, cosine, !reflected);
  if (reflected) f += g.several.reflected * rest;
  else f += g.several.through * (rest * (g.thin ? 1.0f : g.eta * g.eta));
  return f * g.share;
}

vec3 sample_cosine(vec2 u) {
  return vec3(sqrt(u.x) * unit_circle(u.y), sqrt(max(1.0f - u.x, 0.0f)));
}

/// By the cosine, and by forward_density.
vec3 sample_several(IN(Glass) g, vec3 wo, vec2 u) {
  float sine_o = sqrt(max(1.0f - wo.z * wo.z, 0.0f)), sine = sqrt(u.x), spread = g.forward * sine_o * sine;
  vec2 turn = unit_circle(u.y);
  float a = (spread - 1.0f) * turn.y, b = (1.0f + spread) * (1.0f - turn.x), scale = sine / max(a * a + b * b, 1e-30f);
  float along = -scale * (b * b - a * a), across = scale * 2.0f * a * b;
  vec2 o = sine_o > 1e-6f ? xy(wo) / sine_o : vec2(1.0f, 0.0f);
  return vec3(along * o.x - across * o.y, along * o.y + across * o.x, sqrt(max(1.0f - u.x, 0.0f)));
}

/// `choice` in [0, 1) picks one facet or several, reflection or refraction.
GlassSample sample_rough_glass(IN(Glass) g, vec3 wo, vec2 u, float choice) {
  GlassSample s;
  if (choice >= g.albedo) {
    s.transmitted = choice - g.albedo >= g.several.chance * (1.0f - g.albedo);
    s.direction = sample_several(g, wo, u);
    if (s.transmitted) s.direction.z = -s.direction.z;
    s.valid = true;
    return s;
  }
  vec3 h = sample_visible_normal(wo, g.alpha, u);
  float cos_t, o = dot(wo, h);
  s.transmitted = choice >= faces_at(g, o, cos_t).chance * g.albedo;
  s.direction = reflect(-wo, h);
  if (s.transmitted && !g.thin) s.direction = h * (g.eta * o - cos_t) - g.eta * wo;
  s.valid = (s.transmitted && !g.thin) != (s.direction.z > 0.0f);
  if (s.transmitted && g.thin) s.direction.z = -s.direction.z;
  return s;
}

/// Smooth and with a body behind it.
bool bends_light(IN(MaterialPoint) m) { return m.transmission > 0.0f && m.metallic < 1.0f && !is_sheet(m) && glass_alpha(m) < mirror_alpha; }

/// What smooth glass lets through at one boundary, of a ray taken straight on: outside a plane-parallel plate the angle is the same on both sides, so
/// `cosine`, the straight ray's, holds for both of its faces. A sheet is both at once.
Spectrum straight_transmittance(IN(MaterialPoint) m, float cosine) {
  if (glass_alpha(m) >= mirror_alpha) return Spectrum(0.0f);
  float cos_t;
  float reflectance = fresnel_dielectric(cosine, 1.0f / m.ior, cos_t) * m.specular, share = (1.0f - m.metallic) * m.transmission;
  ThinFilm film = thin_film_of(m.iridescence, m.iridescence_ior, m.thin_film_nm);
  if (!is_sheet(m) && !wears_thin_film(film)) return m.base * (share * (1.0f - reflectance));
  Spectrum filmed = under_thin_film(film, 1.0f / m.ior, m.specular, reflectance, cosine);
  return is_sheet(m) ? sheet(filmed, m.base).through * share : m.base * (Spectrum(1.0f) - filmed) * share;
}
#endif
