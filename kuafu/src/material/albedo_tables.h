// SPDX-License-Identifier: Apache-2.0
// Tables of the directional albedos of GGX lobes. Thread rule: pure functions.
// Metal has Schlick's Fresnel, split into the terms of f0 and f90: E(cosine) = f0 x + f90 y (Karis 2013, "split sum").
// A dielectric's layer has the exact one of its index; what several facets scatter is in it. The BSDF dims the base under a layer by it.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <vector>

#include "device/thread_pool.h"

namespace kuafu {

/// Tables of albedos. Metal: [roughness][cosine], specular_albedo_size each, both from 0 to 1; then, per roughness, the mean of x + y over
/// the hemisphere, as x. Layer: [index][roughness], layer_albedo_size each, of specular_albedo_size entries: x at cosine c, y at c + 1. The
/// last entry is the mean over the hemisphere. Indices step evenly in (ior - 1) / (ior + 1).
std::vector<glm::vec2> specular_albedo_table(ks::ThreadPool& workers);

/// Computes one entry of the metal table by quadrature over the visible normals.
glm::vec2 specular_albedo(double cosine, double roughness);

/// Mean of Fresnel's reflectance over the hemisphere, weighted by the cosine (Kulla and Conty 2017's fit).
double layer_fresnel_mean(double ior);

/// Table of rough glass: the share that a single facet reflects and lets through; the rest meets several facets. [index][roughness],
/// glass_albedo_indices and glass_albedo_roughnesses, of 2 (glass_albedo_cosines + 2) entries, x from outside and y from inside. Each has
/// the albedo at the cosines, its mean over the hemisphere, and the mean of albedo times cosine. The second half is for specular 0, with
/// total reflection alone. Steps are even in roughness, in the root of the cosine and in the root of (ior - 1) / (ior + 1). It takes some
/// 100 ms, so it is made for scenes with rough glass.
std::vector<glm::vec2> glass_albedo_table(ks::ThreadPool& workers);

/// Table of sheen: [roughness][root of the cosine], sheen_albedo_roughnesses from the lowest to 1, and specular_albedo_size. x is the
/// albedo of white fibres, y that at the next root. It takes some 10 ms, so it is made for scenes with sheen.
std::vector<glm::vec2> sheen_albedo_table(ks::ThreadPool& workers);

/// Returns all tables as shaders read them: metal and layer, sheen (or zeros), and glass if `frosted`.
std::vector<glm::vec2> albedo_tables(ks::ThreadPool& workers, bool sheen, bool frosted);

// GGX facets as the quadratures take them. Walter et al. 2007, eq. 34, times 2 cos: G1 = 2 cos / (cos + root).
inline double smith_root(double cosine, double a2) { return std::sqrt(a2 + (1 - a2) * cosine * cosine); }

// Dupuy and Benyoub 2023: visible normals from a cap of the sphere. w: wo, stretched to the hemisphere of roughness 1; `turn`: (cos, sin)
// of the cap's longitude; v: 0..1 over its heights.
inline glm::dvec3 visible_normal(const glm::dvec3& w, double alpha, const glm::dvec2& turn, double v) {
  const double z = (1 - v) * (1 + w.z) - w.z, s = std::sqrt(std::max(1 - z * z, 0.0));
  const glm::dvec3 h = glm::dvec3(s * turn.x, s * turn.y, z) + w;
  return glm::normalize(glm::dvec3(h.x * alpha, h.y * alpha, std::max(h.z, 1e-12)));
}

}  // namespace kuafu
