// SPDX-License-Identifier: Apache-2.0
// GGX microfacets with height-correlated Smith masking, in the frame of the normal (z). References: Walter et al. 2007; Heitz, JCGT 2014 and 2018;
// Dupuy and Benyoub, "Sampling Visible GGX Normals with Spherical Caps", 2023.
#ifndef KUAFU_MICROFACET_GLSL
#define KUAFU_MICROFACET_GLSL
#include "lib/language.glsl"

const float pi = 3.14159265358979f;
const float mirror_alpha = 1e-3f;  // below: a mirror

float ggx_distribution(vec3 h, float alpha) {
  float a2 = alpha * alpha;
  float d = dot(xy(h), xy(h)) + a2 * h.z * h.z;
  return a2 / (pi * d * d);
}

float smith_root(float cosine, float a2) { return sqrt(a2 + (1.0f - a2) * cosine * cosine); }

/// G2 / (4 cos_o cos_i)
float ggx_visibility(float cos_o, float cos_i, float alpha) {
  float a2 = alpha * alpha;
  return 0.5f / (cos_i * smith_root(cos_o, a2) + cos_o * smith_root(cos_i, a2));
}

/// The same of light that a facet refracts, which must be free above and below it: the masking function of both sides is Euler's beta of
/// 1 + lambda (Heitz et al. 2016), here by Stirling's series, scaled to be exact where nothing is hidden, and 0.4 % from it at most.
float ggx_refraction_visibility(float cos_o, float cos_i, float alpha) {
  float a2 = alpha * alpha;
  float o = 0.5f + 0.5f * smith_root(cos_o, a2) / cos_o, i = 0.5f + 0.5f * smith_root(cos_i, a2) / cos_i, sum = o + i;
  float power = (o - 0.5f) * log(o / sum) + (i - 0.5f) * log(i / sum) - 0.5f * log(sum);
  return 2.49612f * exp(power + (1.0f / o + 1.0f / i - 1.0f / sum) / 12.0f) / (4.0f * cos_o * cos_i);
}

/// Density of the direction reflected about a visible normal.
float ggx_reflection_pdf(vec3 wo, vec3 h, float alpha) {
  return ggx_distribution(h, alpha) * 0.5f / (wo.z + smith_root(wo.z, alpha * alpha));
}

vec3 sample_visible_normal(vec3 wo, float alpha, vec2 u) {
  vec3 w = normalize(vec3(xy(wo) * alpha, wo.z));
  float z = (1.0f - u.y) * (1.0f + w.z) - w.z;
  float s = sqrt(clamp(1.0f - z * z, 0.0f, 1.0f));
  vec3 h = vec3(s * unit_circle(u.x), z) + w;
  return normalize(vec3(xy(h) * alpha, max(h.z, 1e-7f)));
}

/// The same lobe drawn out along the frame's axes: alphas of x and y (Heitz 2014; Burley, "Physically Based Shading at Disney", 2012).
float ggx_distribution_along(vec3 h, vec2 alphas) {
  vec3 m = vec3(h.x / alphas.x, h.y / alphas.y, h.z);
  float d = dot(m, m);
  return 1.0f / (pi * alphas.x * alphas.y * d * d);
}

float smith_root_along(vec3 w, vec2 alphas) { return length(vec3(w.x * alphas.x, w.y * alphas.y, w.z)); }

float ggx_visibility_along(vec3 wo, vec3 wi, vec2 alphas) {
  return 0.5f / (wi.z * smith_root_along(wo, alphas) + wo.z * smith_root_along(wi, alphas));
}

float ggx_reflection_pdf_along(vec3 wo, vec3 h, vec2 alphas) {
  return ggx_distribution_along(h, alphas) * 0.5f / (wo.z + smith_root_along(wo, alphas));
}

vec3 sample_visible_normal_along(vec3 wo, vec2 alphas, vec2 u) {
  vec3 w = normalize(vec3(wo.x * alphas.x, wo.y * alphas.y, wo.z));
  float z = (1.0f - u.y) * (1.0f + w.z) - w.z;
  float s = sqrt(clamp(1.0f - z * z, 0.0f, 1.0f));
  vec3 h = vec3(s * unit_circle(u.x), z) + w;
  return normalize(vec3(h.x * alphas.x, h.y * alphas.y, max(h.z, 1e-7f)));
}

float schlick_weight(float cosine) {
  float m = clamp(1.0f - cosine, 0.0f, 1.0f);
  float m2 = m * m;
  return m2 * m2 * m;
}

/// Unpolarised reflectance of a smooth boundary; eta = n_incident / n_transmitted. cos_t is 0 with total internal reflection.
float fresnel_dielectric(float cos_i, float eta, OUT(float) cos_t) {
  float sin2_t = eta * eta * (1.0f - cos_i * cos_i);
  cos_t = 0.0f;
  if (sin2_t >= 1.0f) return 1.0f;
  cos_t = sqrt(1.0f - sin2_t);
  float r_s = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  float r_p = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  return 0.5f * (r_s * r_s + r_p * r_p);
}
#endif
