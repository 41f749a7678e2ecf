// SPDX-License-Identifier: Apache-2.0
// Tables of the directional albedos of GGX lobes. Thread rule: pure functions.
// Metal has Schlick's Fresnel, split into the terms of f0 and f90: E(cosine) = f0 x + f90 y (Karis 2013, "split sum").
// A dielectric's layer has the exact one of its index; what several facets scatter is in it. The BSDF dims the base under a layer by it.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "device/thread_pool.h"

namespace kuafu {

/// Metal: [roughness][cosine], specular_albedo_size each, both from 0 to 1; then per roughness the mean of x + y over the hemisphere, as x.
/// Layer: [index][roughness], layer_albedo_size each, of specular_albedo_size entries: the albedo at cosine c as x and at c + 1 as y; the
/// last is its mean over the hemisphere. Indices are at equal steps of (ior - 1) / (ior + 1).
std::vector<glm::vec2> specular_albedo_table(ks::ThreadPool& workers);

/// One entry of metal by quadrature over the visible normals.
glm::vec2 specular_albedo(double cosine, double roughness);

/// Mean of Fresnel's reflectance over the hemisphere, weighted by the cosine (Kulla and Conty 2017's fit).
double layer_fresnel_mean(double ior);

/// Rough glass: what one facet reflects and lets through, of all light; the rest meets several facets.
/// [index][roughness], glass_albedo_indices and glass_albedo_roughnesses, of 2 (glass_albedo_cosines + 2) entries, from outside as x and
/// from inside as y: at the cosines, then the mean over the hemisphere, and that of the albedo times the cosine; and the same once more for
/// specular 0, where only total reflection is left. Steps are equal in the roughness, in the root of the cosine, and in that of
/// (ior - 1) / (ior + 1). Takes some 100 ms of work: for scenes that have rough glass.
std::vector<glm::vec2> glass_albedo_table(ks::ThreadPool& workers);

/// Sheen: [roughness][root of the cosine], sheen_albedo_roughnesses from the least to 1 and specular_albedo_size: the albedo of white
/// fibres as x, that of the next root as y. Takes some 10 ms of work: for scenes that have sheen.
std::vector<glm::vec2> sheen_albedo_table(ks::ThreadPool& workers);

/// All of them as shaders read them: the first, then sheen's, or zeros, then glass's where it is asked for.
std::vector<glm::vec2> albedo_tables(ks::ThreadPool& workers, bool sheen, bool frosted);

}  // namespace kuafu
