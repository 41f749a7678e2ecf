// glTF 2.0's material as one BSDF in the shading frame (z on the viewer's side): diffuse base, GGX lobes of layer and metal, glass.
// A dielectric's layer reflects as Fresnel says of its index, times specular. Its base gets and gives what the layer lets through,
// (1 - E(wo)) (1 - E(wi)) / (1 - mean of E) with the layer's directional albedo E: reciprocal, and a white base loses nothing (Kelemen and
// Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF Model", 2001). Both sides of a surface wear the layer. A glass share
// (transmission) has Fresnel's reflectance from its side and a roughness of its own (Walter et al. 2007). Light that meets several
// microfacets comes back as one more diffuse lobe (Kulla and Conty, "Revisiting Physically Based Shading at Imageworks", 2017).
#ifndef KUAFU_BSDF_GLSL
#define KUAFU_BSDF_GLSL
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

const float mirror_alpha = 1e-3f;  // below: a mirror
const int lobe_size = int(specular_albedo_size), layer_size = int(layer_albedo_size);

struct Bsdf {
  Spectrum diffuse;             // albedo of the base
  Spectrum metal;               // reflectance at normal incidence, and
  float metallic;               // at grazing (Schlick's Fresnel)
  float layer;                  // share of the dielectric layer
  float coat, coat_eta;         // the layer over the base: weight, and 1 / index
  int layer_row;                // its albedos: first row of the table, and the way to the next ones
  float layer_roughness_part, layer_index_part;
  float coat_albedo;            // towards the viewer
  vec2 lobe_albedo;             // metal's split sum, towards the viewer
  float base_scale;             // 1 / (1 - mean of the coat's albedo)
  float roughness, alpha;
  Spectrum multiple;            // of light that met several facets: share of 1 - E that comes back
  float multiple_scale;         // 1 / (1 - mean of E)
  float diffuse_roughness;
  float subsurface;             // share that goes below the surface
  float glass;                  // share of glass
  float glass_alpha;
  float eta;                    // n_viewer / n_other
  float glass_specular;
  Spectrum tint;
};

struct BsdfSample {
  vec3 direction;
  Spectrum weight;  // f cos / pdf
  float pdf;        // of all lobes that are no mirrors; 0 with delta
  bool delta, transmitted;
};

/// The table's cell that x is in, of `size` entries; NaN is in one too.
int table_cell(float x, int size) { return clamp(int(x), 0, size - 2); }

// Split-sum terms of a metal's directional albedo: E = f0 x + f90 y (material/specular_albedo.h).
vec2 lobe_albedo(Vec2Array table, float cosine, float roughness) {
  float x = clamp(cosine, 0.0f, 1.0f) * float(lobe_size - 1), y = clamp(roughness, 0.0f, 1.0f) * float(lobe_size - 1);
  int column = table_cell(x, lobe_size), line = table_cell(y, lobe_size), row = line * lobe_size + column, next = row + lobe_size;
  float f = x - float(column);
  return mix(mix(table.at[row], table.at[row + 1], f), mix(table.at[next], table.at[next + 1], f), y - float(line));
}

/// Where the layer's albedos of an index and a roughness lie in the table.
void find_layer(INOUT(Bsdf) b, float ior) {
  float last = float(layer_size - 1), i = min((ior - 1.0f) / (ior + 1.0f), 1.0f) * last, r = clamp(b.roughness, 0.0f, 1.0f) * last;
  int index = table_cell(i, layer_size), row = table_cell(r, layer_size);
  b.layer_row = int(layer_albedo_first) + (index * layer_size + row) * lobe_size;
  b.layer_roughness_part = r - float(row);
  b.layer_index_part = i - float(index);
}

/// Entry `c` of the layer's rows: albedos at two neighbouring cosines, or the mean.
vec2 layer_entry(IN(Bsdf) b, Vec2Array table, int c) {
  int row = b.layer_row + c, next = row + layer_size * lobe_size;
  vec2 e = mix(table.at[row], table.at[row + lobe_size], b.layer_roughness_part);
  if (b.layer_index_part == 0.0f) return e;
  return mix(e, mix(table.at[next], table.at[next + lobe_size], b.layer_roughness_part), b.layer_index_part);
}

/// Share of light that the layer reflects, single and multiple scattering.
float layer_albedo(IN(Bsdf) b, Vec2Array table, float cosine) {
  float p = clamp(cosine, 0.0f, 1.0f) * float(lobe_size - 1);
  int c = table_cell(p, lobe_size);
  vec2 e = layer_entry(b, table, c);
  return mix(e.x, e.y, p - float(c));
}

float coat_albedo(IN(Bsdf) b, Vec2Array table, float cosine) { return b.coat == 0.0f ? 0.0f : b.coat * layer_albedo(b, table, cosine); }

/// Mean over the hemisphere, weighted by the cosine, of the albedo of a lobe without loss at the facets.
float lobe_mean(Vec2Array table, float roughness) {
  float p = clamp(roughness, 0.0f, 1.0f) * float(lobe_size - 1);
  int i = table_cell(p, lobe_size), first = lobe_size * lobe_size;
  return mix(table.at[first + i].x, table.at[first + i + 1].x, p - float(i));
}

// F_avg^2 E / (1 - F_avg (1 - E))
Spectrum multiple_share(Spectrum average, float mean) { return average * average * mean / (Spectrum(1.0f) - average * (1.0f - mean)); }

bool is_mirror(IN(Bsdf) b) { return b.alpha < mirror_alpha; }
bool has_lobe(IN(Bsdf) b) { return b.metallic + b.layer > 0.0f; }
bool is_rough_glass(IN(Bsdf) b) { return (features & feature_materials) != 0u && b.glass > 0.0f && b.glass_alpha >= mirror_alpha; }

/// What several facets scatter. Means of Fresnel's reflectance: Schlick's exactly, the layer's by Kulla and Conty's fit.
void set_multiple(INOUT(Bsdf) b, IN(MaterialPoint) m, Vec2Array table) {
  float mean = lobe_mean(table, b.roughness), layer_mean = (m.ior - 1.0f) / (4.08567f + 1.00071f * m.ior);
  b.multiple = multiple_share(m.base + (Spectrum(1.0f) - m.base) * (1.0f / 21.0f), mean) * b.metallic;
  b.multiple += Spectrum(b.layer * (layer_mean * layer_mean * mean / (1.0f - layer_mean * (1.0f - mean))));
  b.multiple_scale = 1.0f / max(1.0f - mean, 1e-4f);
}

/// Alpha of the glass. An index that bends nothing has no facets to be seen: its half vectors vanish, and rays go straight on.
float glass_alpha(IN(MaterialPoint) m) { return m.ior < 1.001f ? 0.0f : m.transmission_roughness * m.transmission_roughness; }

Bsdf make_bsdf(IN(MaterialPoint) m, Vec2Array table, float cos_o, bool front) {
  Bsdf b;
  float dielectric = (1.0f - m.metallic) * (1.0f - m.transmission);
  b.diffuse = m.base * dielectric;
  b.subsurface = 0.0f;
  if ((features & feature_subsurface) != 0u && front) {
    b.subsurface = m.subsurface * dielectric;
    b.diffuse *= 1.0f - m.subsurface;
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
  b.coat_albedo = 0.0f;
  b.base_scale = 1.0f;
  b.layer_row = 0;
  b.layer_roughness_part = b.layer_index_part = 0.0f;
  if (b.layer > 0.0f) {
    find_layer(b, m.ior);
    b.coat_albedo = coat_albedo(b, table, cos_o);
    b.base_scale = 1.0f / (1.0f - b.coat * min(layer_entry(b, table, lobe_size - 1).x, 0.9999f));
  }
  if ((features & feature_materials) != 0u) {
    b.diffuse_roughness = m.diffuse_roughness;
    b.glass_alpha = glass_alpha(m);
  }
  b.glass = (1.0f - m.metallic) * m.transmission;
  b.eta = front ? 1.0f / m.ior : m.ior;
  b.glass_specular = m.specular;
  b.tint = m.base;
  return b;
}

/// Has a part that light from a point can be scattered by.
bool takes_light(IN(Bsdf) b) { return max_component(b.diffuse) > 0.0f || (has_lobe(b) && !is_mirror(b)) || is_rough_glass(b); }

/// Fresnel's reflectance of layer and metal where light meets a facet at this cosine.
Spectrum lobe_fresnel(IN(Bsdf) b, float cosine) {
  Spectrum f = b.metal + (Spectrum(b.metallic) - b.metal) * schlick_weight(cosine);
  float cos_t;
  if (b.layer > 0.0f) f += Spectrum(b.layer * fresnel_dielectric(min(cosine, 1.0f), b.coat_eta, cos_t));
  return f;
}

/// Chances of taking the base and what several facets scatter, the GGX lobe and the glass; the rest goes below the surface.
vec3 lobe_chances(IN(Bsdf) b) {
  vec3 w = vec3(max_component(b.diffuse) * (1.0f - b.coat_albedo), 0.0f, b.glass);
  if (has_lobe(b)) {
    w.y = dot(b.lobe_albedo, vec2(max_component(b.metal), b.metallic));
    if (b.layer > 0.0f) w.y += b.layer / b.coat * b.coat_albedo;
    w.x += max_component(b.multiple) * max(1.0f - b.lobe_albedo.x - b.lobe_albedo.y, 0.0f);
  }
  float sum = w.x + w.y + w.z;
  if ((features & feature_subsurface) != 0u) sum += b.subsurface * (1.0f - b.coat_albedo);
  return sum > 0.0f ? w / sum : vec3(0.0f);
}

/// Lambert's 1 / pi, or rough diffuse: Oren and Nayar 1994 in Fujii's form, which is reciprocal and creates no energy.
float diffuse_shape(float roughness, vec3 wo, vec3 wi) {
  if ((features & feature_materials) == 0u || roughness == 0.0f) return 1.0f / pi;
  float s = dot(wo, wi) - wo.z * wi.z, t = s > 0.0f ? max(wo.z, wi.z) : 1.0f;
  return (1.0f + roughness * s / max(t, 1e-6f)) / (pi + (pi / 2.0f - 2.0f / 3.0f) * roughness);
}

float glass_reflectance(IN(Bsdf) b, float cosine, OUT(float) cos_t) {
  float reflectance = fresnel_dielectric(cosine, b.eta, cos_t);
  return cos_t > 0.0f ? reflectance * b.glass_specular : reflectance;
}

/// f cos of rough glass, both sides, and the density of sample_rough_glass times its chance (Walter et al. 2007, eq. 20, 21).
Spectrum evaluate_glass(IN(Bsdf) b, vec3 wo, vec3 wi, float chance, OUT(float) pdf) {
  bool reflected = wi.z > 0.0f;
  vec3 h = normalize(reflected ? wo + wi : -(b.eta * wo + wi));
  pdf = 0.0f;
  if (h.z < 0.0f) h = -h;
  float cos_t, o = dot(wo, h), i = dot(wi, h);
  if (o <= 0.0f || reflected != (i > 0.0f)) return Spectrum(0.0f);
  float reflectance = glass_reflectance(b, o, cos_t), visible = ggx_reflection_pdf(wo, h, b.glass_alpha);
  float facets = ggx_distribution(h, b.glass_alpha) * ggx_visibility(wo.z, abs(wi.z), b.glass_alpha) * abs(wi.z);
  if (reflected) {
    pdf = chance * reflectance * visible;
    return Spectrum(b.glass * reflectance * facets);
  }
  float way = b.eta * o + i, turn = 4.0f * o * abs(i) / (way * way);  // of facet to direction, times the 4 o of reflection
  pdf = chance * (1.0f - reflectance) * visible * turn;
  return b.tint * (b.glass * (1.0f - reflectance) * facets * turn * b.eta * b.eta);
}

/// f cos of the parts that are no mirrors, and the density of bsdf_sample for them.
Spectrum bsdf_evaluate(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 wi, vec3 chances, OUT(float) pdf) {
  pdf = 0.0f;
  Spectrum f = Spectrum(0.0f);
  if (is_rough_glass(b)) f = evaluate_glass(b, wo, wi, chances.z, pdf);
  if (wi.z <= 0.0f) return f;
  pdf += chances.x * wi.z / pi;
  if (max_component(b.diffuse) > 0.0f) {
    float through = 1.0f;
    if (b.coat > 0.0f) through = (1.0f - b.coat_albedo) * (1.0f - coat_albedo(b, table, wi.z)) * b.base_scale;
    f += b.diffuse * (through * wi.z * diffuse_shape(b.diffuse_roughness, wo, wi));
  }
  if (has_lobe(b) && !is_mirror(b)) {
    vec3 h = normalize(wo + wi);
    f += lobe_fresnel(b, dot(wo, h)) * (ggx_distribution(h, b.alpha) * ggx_visibility(wo.z, wi.z, b.alpha) * wi.z);
    vec2 e_i = lobe_albedo(table, wi.z, b.roughness);
    f += b.multiple * (max(1.0f - b.lobe_albedo.x - b.lobe_albedo.y, 0.0f) * max(1.0f - e_i.x - e_i.y, 0.0f) * b.multiple_scale * wi.z / pi);
    pdf += chances.y * ggx_reflection_pdf(wo, h, b.alpha);
  }
  return f;
}

vec3 sample_cosine(vec2 u) {
  return vec3(sqrt(u.x) * unit_circle(u.y), sqrt(max(1.0f - u.x, 0.0f)));
}

// `choice` in [0,1) picks reflection or refraction. Radiance shrinks by eta squared as it leaves the denser side (Veach 1997, 5.2).
BsdfSample sample_glass(IN(Bsdf) b, vec3 wo, float choice) {
  BsdfSample s;
  float cos_t;
  float reflectance = glass_reflectance(b, wo.z, cos_t);
  s.pdf = 0.0f;
  s.delta = true;
  s.transmitted = choice >= reflectance;
  s.direction = s.transmitted ? vec3(-b.eta * xy(wo), -cos_t) : vec3(-xy(wo), wo.z);
  s.weight = s.transmitted ? b.tint * (b.eta * b.eta) : Spectrum(1.0f);
  return s;
}

/// What smooth glass lets through at one boundary, of a ray taken straight on: outside a plane-parallel plate the angle is the same on both sides, so
/// `cosine`, the straight ray's, holds for both of its faces.
Spectrum straight_transmittance(IN(MaterialPoint) m, float cosine) {
  if (glass_alpha(m) >= mirror_alpha) return Spectrum(0.0f);
  float cos_t;
  float reflectance = fresnel_dielectric(cosine, 1.0f / m.ior, cos_t) * m.specular;
  return m.base * ((1.0f - m.metallic) * m.transmission * (1.0f - reflectance));
}

BsdfSample sample_rough_glass(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, float choice) {
  BsdfSample s = BsdfSample(vec3(0.0f, 0.0f, 1.0f), Spectrum(0.0f), 0.0f, false, false);
  vec3 h = sample_visible_normal(wo, b.glass_alpha, u);
  float cos_t, o = dot(wo, h), reflectance = glass_reflectance(b, o, cos_t);
  s.transmitted = choice >= reflectance;
  s.direction = s.transmitted ? h * (b.eta * o - cos_t) - b.eta * wo : reflect(-wo, h);
  if (s.transmitted == (s.direction.z > 0.0f)) return s;
  Spectrum f = bsdf_evaluate(b, table, wo, s.direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}

/// By the GGX lobe, which is no mirror, or by the base.
BsdfSample sample_opaque(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, bool lobe) {
  BsdfSample s = BsdfSample(vec3(0.0f), Spectrum(0.0f), 0.0f, false, false);
  vec3 mirrored = reflect(-wo, sample_visible_normal(wo, b.alpha, u)), diffuse = sample_cosine(u);
  s.direction = vec3(lobe ? mirrored.x : diffuse.x, lobe ? mirrored.y : diffuse.y, lobe ? mirrored.z : diffuse.z);
  Spectrum f = bsdf_evaluate(b, table, wo, s.direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}

BsdfSample bsdf_sample(IN(Bsdf) b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, float choice) {
  BsdfSample s = BsdfSample(vec3(0.0f, 0.0f, 1.0f), Spectrum(0.0f), 0.0f, false, false);
  if (choice < chances.z) {
    if (is_rough_glass(b)) return sample_rough_glass(b, table, wo, chances, u, choice / chances.z);
    s = sample_glass(b, wo, choice / chances.z);
    s.weight *= b.glass / chances.z;
    return s;
  }
  bool lobe = choice < chances.z + chances.y;
  if (lobe && is_mirror(b)) {
    s.direction = vec3(-xy(wo), wo.z);
    s.weight = lobe_fresnel(b, wo.z) / chances.y;
    s.delta = true;
    return s;
  }
  if (!lobe && chances.x == 0.0f) return s;
  return sample_opaque(b, table, wo, chances, u, lobe);
}
#endif
