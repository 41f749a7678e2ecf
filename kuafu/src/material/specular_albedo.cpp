#include "material/specular_albedo.h"

#include <cmath>
#include <numbers>

#include "shared/scene_records.h"

namespace kuafu {
namespace {

// Walter et al. 2007, eq. 34, times 2 cos: G1 = 2 cos / (cos + root).
double smith_root(double cosine, double a2) { return std::sqrt(a2 + (1 - a2) * cosine * cosine); }

// Dupuy and Benyoub 2023: visible normals from a cap of the sphere.
glm::dvec3 visible_normal(const glm::dvec3& wo, double alpha, double u, double v) {
  const glm::dvec3 w = glm::normalize(glm::dvec3(wo.x * alpha, wo.y * alpha, wo.z));
  const double phi = 2 * std::numbers::pi * u, z = (1 - v) * (1 + w.z) - w.z, s = std::sqrt(std::max(1 - z * z, 0.0));
  const glm::dvec3 h = glm::dvec3(s * std::cos(phi), s * std::sin(phi), z) + w;
  return glm::normalize(glm::dvec3(h.x * alpha, h.y * alpha, std::max(h.z, 1e-12)));
}

/// Mean of a lobe's albedo x + y over the hemisphere, weighted by 2 cosine: exact for its piecewise linear table.
float hemisphere_mean(const glm::vec2* row) {
  constexpr double step = 1.0 / (specular_albedo_size - 1);
  double sum = 0;
  for (uint32_t i = 0; i + 1 < specular_albedo_size; ++i) {
    const double a = row[i].x + row[i].y, b = row[i + 1].x + row[i + 1].y, c = i * step;
    sum += 2 * step * (a * (c / 2 + step / 6) + b * (c / 2 + step / 3));
  }
  return float(sum);
}

}  // namespace

glm::vec2 specular_albedo(double cosine, double roughness) {
  constexpr int across = 12, along = 32;  // midpoints of the half of the cap that mirrors the other, and of its height
  const double alpha = roughness * roughness, a2 = alpha * alpha, c = std::max(cosine, 1e-4);
  const glm::dvec3 wo(std::sqrt(1 - c * c), 0, c);
  glm::dvec2 sum(0);
  for (int i = 0; i < across; ++i)
    for (int j = 0; j < along; ++j) {
      const glm::dvec3 h = visible_normal(wo, alpha, (i + 0.5) / (2 * across), (j + 0.5) / along);
      const double oh = glm::dot(wo, h), cos_i = 2 * oh * h.z - wo.z;
      if (cos_i <= 0) continue;
      // f cos / pdf = F G2 / G1
      const double weight = cos_i * (c + smith_root(c, a2)) / (cos_i * smith_root(c, a2) + c * smith_root(cos_i, a2));
      const double m = 1 - oh, schlick = m * m * m * m * m;
      sum += weight * glm::dvec2(1 - schlick, schlick);
    }
  return sum / double(across * along);
}

std::vector<glm::vec2> specular_albedo_table() {
  std::vector<glm::vec2> table;
  table.reserve(size_t(specular_albedo_size) * (specular_albedo_size + 1));
  for (uint32_t r = 0; r < specular_albedo_size; ++r)
    for (uint32_t c = 0; c < specular_albedo_size; ++c)
      table.push_back(specular_albedo(double(c) / (specular_albedo_size - 1), double(r) / (specular_albedo_size - 1)));
  for (uint32_t r = 0; r < specular_albedo_size; ++r) table.emplace_back(hemisphere_mean(&table[size_t(r) * specular_albedo_size]), 0.0f);
  return table;
}

}  // namespace kuafu
