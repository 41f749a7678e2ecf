// glTF 2.0's material as one BSDF in the shading frame (z on the viewer's side): Lambert base, GGX lobe of coat and metal, smooth glass.
// The base keeps what the coat does not reflect, min(1 - E(wo), 1 - E(wi)) with the coat's directional albedo E: reciprocal, creates no energy, and
// equals glTF's (1 - F) away from grazing angles. A glass share (transmission) is smooth, with exact Fresnel.
#ifndef KUAFU_BSDF_GLSL
#define KUAFU_BSDF_GLSL
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

const float mirror_alpha = 1e-3f;  // below: a mirror

struct Bsdf {
  Spectrum diffuse;             // albedo of the base
  Spectrum f0;                  // of the whole GGX lobe
  float f90;
  float coat_f0, coat_f90;      // of the dielectric coat alone, which dims the base
  float coat_albedo;            // towards the viewer
  float roughness, alpha;
  float glass;                  // share of smooth glass
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

// Split-sum terms of the GGX lobe's directional albedo: E = f0 x + f90 y (material/specular_albedo.h).
vec2 lobe_albedo(Vec2Array table, float cosine, float roughness) {
  vec2 p = clamp(vec2(cosine, roughness), 0.0f, 1.0f) * float(specular_albedo_size - 1u);
  uvec2 i = min(uvec2(p), uvec2(specular_albedo_size - 2u));
  vec2 f = p - vec2(i);
  uint row = i.y * specular_albedo_size + i.x, next = row + specular_albedo_size;
  return mix(mix(table.at[row], table.at[row + 1u], f.x), mix(table.at[next], table.at[next + 1u], f.x), f.y);
}

float coat_albedo(Bsdf b, Vec2Array table, float cosine) {
  if (b.coat_f90 == 0.0f) return 0.0f;
  return dot(lobe_albedo(table, cosine, b.roughness), vec2(b.coat_f0, b.coat_f90));
}

Bsdf make_bsdf(MaterialPoint m, Vec2Array table, float cos_o, bool front) {
  Bsdf b;
  float dielectric = (1.0f - m.metallic) * (1.0f - m.transmission);
  float r = (m.ior - 1.0f) / (m.ior + 1.0f);
  b.diffuse = m.base * dielectric;
  b.coat_f0 = r * r * m.specular;
  b.coat_f90 = m.specular;
  b.f0 = Spectrum(b.coat_f0 * dielectric) + m.base * m.metallic;
  b.f90 = b.coat_f90 * dielectric + m.metallic;
  b.roughness = m.roughness;
  b.coat_albedo = coat_albedo(b, table, cos_o);
  b.alpha = m.roughness * m.roughness;
  b.glass = (1.0f - m.metallic) * m.transmission;
  b.eta = front ? 1.0f / m.ior : m.ior;
  b.glass_specular = m.specular;
  b.tint = m.base;
  return b;
}

bool is_mirror(Bsdf b) { return b.alpha < mirror_alpha; }
/// Has a part that light from a point can be scattered by.
bool takes_light(Bsdf b) { return max_component(b.diffuse) > 0.0f || (b.f90 > 0.0f && !is_mirror(b)); }

/// Chances of taking the base, the GGX lobe and the glass.
vec3 lobe_chances(Bsdf b, Vec2Array table, float cos_o) {
  vec3 w = vec3(max_component(b.diffuse) * (1.0f - b.coat_albedo), 0.0f, b.glass);
  if (b.f90 > 0.0f) w.y = dot(lobe_albedo(table, cos_o, b.roughness), vec2(max_component(b.f0), b.f90));
  float sum = w.x + w.y + w.z;
  return sum > 0.0f ? w / sum : vec3(0.0f);
}

/// f cos of the parts that are no mirrors, and the density of bsdf_sample for them.
Spectrum bsdf_evaluate(Bsdf b, Vec2Array table, vec3 wo, vec3 wi, vec3 chances, OUT(float) pdf) {
  pdf = 0.0f;
  if (wi.z <= 0.0f) return Spectrum(0.0f);
  Spectrum f = Spectrum(0.0f);
  if (max_component(b.diffuse) > 0.0f) {
    float dimming = 1.0f - max(b.coat_albedo, coat_albedo(b, table, wi.z));
    f += b.diffuse * (dimming * wi.z / pi);
    pdf += chances.x * wi.z / pi;
  }
  if (b.f90 > 0.0f && !is_mirror(b)) {
    vec3 h = normalize(wo + wi);
    float schlick = schlick_weight(dot(wo, h));
    Spectrum fresnel = b.f0 + (Spectrum(b.f90) - b.f0) * schlick;
    f += fresnel * (ggx_distribution(h, b.alpha) * ggx_visibility(wo.z, wi.z, b.alpha) * wi.z);
    pdf += chances.y * ggx_reflection_pdf(wo, h, b.alpha);
  }
  return f;
}

vec3 sample_cosine(vec2 u) {
  float radius = sqrt(u.x), phi = 2.0f * pi * u.y;
  return vec3(radius * cos(phi), radius * sin(phi), sqrt(max(1.0f - u.x, 0.0f)));
}

// `choice` in [0,1) picks reflection or refraction. Radiance shrinks by eta squared as it leaves the denser side (Veach 1997, 5.2).
BsdfSample sample_glass(Bsdf b, vec3 wo, float choice) {
  BsdfSample s;
  float cos_t;
  float reflectance = fresnel_dielectric(wo.z, b.eta, cos_t);
  if (cos_t > 0.0f) reflectance *= b.glass_specular;
  s.pdf = 0.0f;
  s.delta = true;
  s.transmitted = choice >= reflectance;
  s.direction = s.transmitted ? vec3(-b.eta * xy(wo), -cos_t) : vec3(-xy(wo), wo.z);
  s.weight = s.transmitted ? b.tint * (b.eta * b.eta) : Spectrum(1.0f);
  return s;
}

/// What smooth glass lets through at one boundary, of a ray taken straight on: outside a plane-parallel plate the angle is the same on both sides, so
/// `cosine`, the straight ray's, holds for both of its faces.
Spectrum straight_transmittance(MaterialPoint m, float cosine) {
  float cos_t;
  float reflectance = fresnel_dielectric(cosine, 1.0f / m.ior, cos_t) * m.specular;
  return m.base * ((1.0f - m.metallic) * m.transmission * (1.0f - reflectance));
}

BsdfSample bsdf_sample(Bsdf b, Vec2Array table, vec3 wo, vec3 chances, vec2 u, float choice) {
  BsdfSample s = BsdfSample(vec3(0.0f, 0.0f, 1.0f), Spectrum(0.0f), 0.0f, false, false);
  if (choice < chances.z) {
    s = sample_glass(b, wo, choice / chances.z);
    s.weight *= b.glass / chances.z;
    return s;
  }
  bool lobe = choice < chances.z + chances.y;
  if (lobe && is_mirror(b)) {
    s.direction = vec3(-xy(wo), wo.z);
    s.weight = (b.f0 + (Spectrum(b.f90) - b.f0) * schlick_weight(wo.z)) / chances.y;
    s.delta = true;
    return s;
  }
  if (!lobe && chances.x == 0.0f) return s;
  s.direction = lobe ? reflect(-wo, sample_visible_normal(wo, b.alpha, u)) : sample_cosine(u);
  Spectrum f = bsdf_evaluate(b, table, wo, s.direction, chances, s.pdf);
  if (s.pdf > 0.0f) s.weight = f / s.pdf;
  return s;
}
#endif
