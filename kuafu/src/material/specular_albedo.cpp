// SPDX-License-Identifier: Apache-2.0
#include "material/albedo_tables.h"

#include <cmath>
#include <numbers>

#include "shared/scene_records.h"

namespace kuafu {
namespace {

/// Calls take(cosine to the facet, weight) for the midpoints of the half of the visible normals that mirrors the other; weight = f cos /
/// pdf without Fresnel's reflectance, divided by their number.
template <class Take>
void over_facets(double cosine, double roughness, int across, int along, const Take& take) {
  const double alpha = roughness * roughness, a2 = alpha * alpha, c = std::max(cosine, 1e-4);
  const glm::dvec3 wo(std::sqrt(1 - c * c), 0, c), w = glm::normalize(glm::dvec3(wo.x * alpha, wo.y * alpha, wo.z));
  for (int i = 0; i < across; ++i) {
    const double phi = 2 * std::numbers::pi * ((i + 0.5) / (2 * across));
    const glm::dvec2 turn(std::cos(phi), std::sin(phi));
    for (int j = 0; j < along; ++j) {
      const glm::dvec3 h = visible_normal(w, alpha, turn, (j + 0.5) / along);
      const double oh = glm::dot(wo, h), cos_i = 2 * oh * h.z - wo.z;
      if (cos_i <= 0) continue;
      const double weight = cos_i * (c + smith_root(c, a2)) / (cos_i * smith_root(c, a2) + c * smith_root(cos_i, a2));  // F G2 / G1
      take(oh, weight / (across * along));
    }
  }
}

/// Mean of values at equal steps of the cosine over the hemisphere, weighted by 2 cosine: exact for piecewise linear ones.
template <class Value>
double hemisphere_mean(uint32_t size, const Value& value) {
  const double step = 1.0 / (size - 1);
  double sum = 0;
  for (uint32_t i = 0; i + 1 < size; ++i) {
    const double c = i * step;
    sum += 2 * step * (value(i) * (c / 2 + step / 6) + value(i + 1) * (c / 2 + step / 3));
  }
  return sum;
}

double fresnel(double cosine, double ior) {
  const double cos_t = std::sqrt(1 - (1 - cosine * cosine) / (ior * ior));
  const double s = (cosine - ior * cos_t) / (cosine + ior * cos_t), p = (ior * cosine - cos_t) / (ior * cosine + cos_t);
  return (s * s + p * p) / 2;
}

/// Kulla and Conty 2017: F_avg^2 E / (1 - F_avg (1 - E)).
double multiple_share(double average, double mean) { return average * average * mean / (1 - average * (1 - mean)); }

double layer_ior(uint32_t i) {
  const double root_f0 = std::min(double(i) / (layer_albedo_size - 1), 1 - 1e-6);
  return (1 + root_f0) / (1 - root_f0);
}

/// The layer's directional albedos of one roughness, for all indices: facets are the same for each.
void write_layers(std::vector<glm::vec2>& table, uint32_t roughness) {
  constexpr uint32_t size = specular_albedo_size, iors = layer_albedo_size;
  std::vector<double> ior(iors), single(size_t(iors) * size), lossless(size);
  for (uint32_t i = 0; i < iors; ++i) ior[i] = layer_ior(i);
  for (uint32_t c = 0; c < size; ++c)
    over_facets(double(c) / (size - 1), double(roughness) / (layer_albedo_size - 1), 6, 24, [&](double oh, double weight) {
      for (uint32_t i = 0; i < iors; ++i) single[i * size + c] += weight * fresnel(std::min(oh, 1.0), ior[i]);
      lossless[c] += weight;
    });
  const double lossless_mean = hemisphere_mean(size, [&](uint32_t c) { return lossless[c]; });
  for (uint32_t i = 0; i < iors; ++i) {
    const double share = multiple_share(layer_fresnel_mean(ior[i]), lossless_mean);
    const auto albedo = [&](uint32_t c) { return single[i * size + c] + share * (1 - lossless[c]); };
    glm::vec2* row = &table[layer_albedo_first + (size_t(i) * layer_albedo_size + roughness) * size];
    for (uint32_t c = 0; c + 1 < size; ++c) row[c] = {float(albedo(c)), float(albedo(c + 1))};
    row[size - 1] = {float(hemisphere_mean(size, albedo)), 0.0f};
  }
}

}  // namespace

double layer_fresnel_mean(double ior) { return (ior - 1) / (4.08567 + 1.00071 * ior); }

glm::vec2 specular_albedo(double cosine, double roughness) {
  glm::dvec2 sum(0);
  over_facets(cosine, roughness, 12, 32, [&](double oh, double weight) {
    const double m = 1 - oh, schlick = m * m * m * m * m;
    sum += weight * glm::dvec2(1 - schlick, schlick);
  });
  return sum;
}

std::vector<glm::vec2> specular_albedo_table(ks::ThreadPool& workers) {
  constexpr uint32_t size = specular_albedo_size;
  std::vector<glm::vec2> table(specular_albedo_entries);
  workers.parallel_for(size, [&](size_t r) {
    glm::vec2* row = &table[r * size];
    for (uint32_t c = 0; c < size; ++c) row[c] = specular_albedo(double(c) / (size - 1), double(r) / (size - 1));
    table[size_t(size) * size + r] = {float(hemisphere_mean(size, [&](uint32_t c) { return double(row[c].x) + double(row[c].y); })), 0.0f};
  });
  workers.parallel_for(layer_albedo_size, [&](size_t r) { write_layers(table, uint32_t(r)); });
  return table;
}

}  // namespace kuafu
