// SPDX-License-Identifier: Apache-2.0
#include "material/albedo_tables.h"

#include <array>
#include <numbers>

#include "shared/scene_records.h"

namespace kuafu {
namespace {

constexpr uint32_t cosines = glass_albedo_cosines, plane = cosines + 2, row_size = 2 * plane;
constexpr uint32_t sides = 2 * glass_albedo_indices;  // outside of each index, then inside
constexpr int free_entries = 128;
constexpr int facets = 377;  // visible normals of one direction: of the half that mirrors the other
// On a Fibonacci lattice: seen from the normal, where one of the two coordinates is idle, they still all differ.
constexpr double golden = 0.6180339887498949;

/// n here / n beyond, of each side.
std::array<float, sides> index_ratios() {
  std::array<float, sides> ratios{};
  for (uint32_t i = 0; i < glass_albedo_indices; ++i) {
    const double place = std::min(double(i) / (glass_albedo_indices - 1), 1 - 1e-3), root_f0 = place * place;
    ratios[i] = float((1 - root_f0) / (1 + root_f0));
    ratios[glass_albedo_indices + i] = 1 / ratios[i];
  }
  return ratios;
}

/// Light from one direction, and what it has met: with Fresnel's reflectance, and with total reflection alone.
struct Light {
  Light(float cos_o, float alpha_squared);

  float cosine, a2, root;
  float free_below[free_entries + 1];  // f cos / pdf of a facet that refracts it, but for Fresnel's factor, at equal steps of Smith's G1
  float full[sides] = {}, bare[sides] = {};
};

// Heitz et al. 2016: of light that a facet refracts, Euler's beta of 1 + lambda of both directions is free; 1 + lambda = 1 / G1.
Light::Light(float cos_o, float alpha_squared) : cosine(cos_o), a2(alpha_squared), root(float(smith_root(cos_o, alpha_squared))) {
  const double o = (1 + double(root) / double(cosine)) / 2;
  free_below[0] = 0;
  for (int k = 1; k <= free_entries; ++k) {
    const double i = double(free_entries) / k;
    free_below[k] = float(o * std::exp(std::lgamma(o) + std::lgamma(i) - std::lgamma(o + i)));
  }
}

/// f cos / pdf of a facet that reflects it to cosine c, but for Fresnel's factor.
inline float facet_weight(const Light& l, float c) {
  const float weight = c * (l.cosine + l.root) / (c * l.root + l.cosine * std::sqrt(l.a2 + (1 - l.a2) * c * c) + 1e-20f);
  return c <= 0 ? 0 : weight;
}

/// The same of a facet that refracts it.
inline float refracted_weight(const Light& l, float c) {
  const float place = c <= 0 ? 0 : 2 * c / (c + std::sqrt(l.a2 + (1 - l.a2) * c * c)) * free_entries;
  const int entry = std::min(int(place), free_entries - 1);
  return l.free_below[entry] + (l.free_below[entry + 1] - l.free_below[entry]) * (place - float(entry));
}

/// Adds facet h, which meets the light at cosine o, for all sides at once (vectorised).
void add_facet(Light& l, const std::array<float, sides>& ratios, float h_z, float o) {
  const float mirrored = facet_weight(l, 2 * o * h_z - l.cosine);
  for (uint32_t i = 0; i < sides; ++i) {
    const float ratio = ratios[i], rest = 1 - ratio * ratio * (1 - o * o), cos_t = std::sqrt(std::max(rest, 0.0f));
    const float s = (ratio * o - cos_t) / (ratio * o + cos_t), p = (o - ratio * cos_t) / (o + ratio * cos_t);
    const float reflectance = (s * s + p * p) / 2, refracted = refracted_weight(l, ratio * l.cosine - h_z * (ratio * o - cos_t));
    const bool total = rest <= 0;
    l.full[i] += total ? mirrored : reflectance * mirrored + (1 - reflectance) * refracted;
    l.bare[i] += total ? mirrored : refracted;
  }
}

/// Fills column `c` of a roughness in the rows of all indices: visible normals do not depend on them.
void fill_column(glm::vec2* rows, uint32_t c, double alpha, const std::array<float, sides>& ratios) {
  const double root = double(c) / (cosines - 1), cosine = std::max(root * root, 1e-4);
  const glm::dvec3 wo(std::sqrt(1 - cosine * cosine), 0, cosine), w = glm::normalize(glm::dvec3(wo.x * alpha, 0, wo.z));
  Light l(float(cosine), float(alpha * alpha));
  for (int k = 0; k < facets; ++k) {
    const double phi = std::numbers::pi * (k + 0.5) / facets;
    const glm::dvec3 h = visible_normal(w, alpha, {std::cos(phi), std::sin(phi)}, std::fmod(0.5 + k * golden, 1.0));
    add_facet(l, ratios, float(h.z), float(std::min(glm::dot(wo, h), 1.0)));
  }
  for (uint32_t i = 0; i < glass_albedo_indices; ++i) {
    glm::vec2* row = rows + size_t(i) * glass_albedo_roughnesses * row_size;
    row[c] = glm::vec2(l.full[i], l.full[glass_albedo_indices + i]) / float(facets);
    row[plane + c] = glm::vec2(l.bare[i], l.bare[glass_albedo_indices + i]) / float(facets);
  }
}

/// Integral of 4 u^n over the root u of the cosine: exact for what is piecewise linear in u. n = 3 is the mean over the hemisphere,
/// weighted by 2 cosine; n = 5 is that of the same times the cosine.
glm::vec2 moment(const glm::vec2* row, int n) {
  const auto power = [](uint32_t c, int p) { return std::pow(double(c) / (cosines - 1), p) * 4 / p; };
  glm::dvec2 sum(0);
  for (uint32_t c = 0; c + 1 < cosines; ++c) {
    const double all = power(c + 1, n + 1) - power(c, n + 1), from = double(c) / (cosines - 1);
    const double right = (power(c + 1, n + 2) - power(c, n + 2) - from * all) * (cosines - 1);
    sum += (all - right) * glm::dvec2(row[c]) + right * glm::dvec2(row[c + 1]);
  }
  return sum;
}

}  // namespace

std::vector<glm::vec2> glass_albedo_table(ks::ThreadPool& workers) {
  std::vector<glm::vec2> table(size_t(glass_albedo_indices) * glass_albedo_roughnesses * row_size);
  const std::array<float, sides> ratios = index_ratios();
  workers.parallel_for(glass_albedo_roughnesses, [&](size_t r) {
    const double roughness = double(r) / (glass_albedo_roughnesses - 1);
    for (uint32_t c = 0; c < cosines; ++c) fill_column(&table[r * row_size], c, roughness * roughness, ratios);
  });
  for (size_t row = 0; row < table.size(); row += plane) {
    table[row + cosines] = moment(&table[row], 3);
    table[row + cosines + 1] = moment(&table[row], 5);
  }
  return table;
}

}  // namespace kuafu
