// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "material/albedo_tables.h"
#include "shared/scene_records.h"

namespace kuafu {
namespace {

constexpr int heights = 32, turns = 24;

// Estevez and Kulla 2017, as lib/sheen.glsl has it.
double masking_fit(double x, double alpha) {
  const double smoother = (1 - alpha) * (1 - alpha);
  const auto between = [&](double rough, double smooth) { return rough + (smooth - rough) * smoother; };
  const double a = between(21.5473, 25.3245), b = between(3.82987, 3.32435), c = between(0.19823, 0.16801);
  return a / (1 + b * std::pow(x, c)) + between(-1.97760, -1.27393) * x + between(-4.32054, -4.85967);
}

double masking(double cosine, double alpha) {
  if (cosine < 0.5) return std::exp(masking_fit(cosine, alpha));
  return std::exp(2 * masking_fit(0.5, alpha) - masking_fit(1 - cosine, alpha));
}

/// Integral of the lobe over the hemisphere, from the middles of equal steps of the square of the angle from grazing, where it is large.
double albedo(double cosine, double alpha) {
  const double cos_o = std::max(cosine, 1e-3), sin_o = std::sqrt(1 - cos_o * cos_o), masked_o = masking(cos_o, alpha);
  double sum = 0;
  for (int i = 0; i < heights; ++i) {
    const double part = (i + 0.5) / heights, elevation = std::numbers::pi / 2 * part * part, width = std::numbers::pi * part / heights;
    const double cos_i = std::sin(elevation), sin_i = std::cos(elevation);
    double turned = 0;
    for (int j = 0; j < turns; ++j) {
      const double phi = std::numbers::pi * (j + 0.5) / turns, dot = cos_o * cos_i + sin_o * sin_i * std::cos(phi);
      const double h = (cos_o + cos_i) / std::sqrt(2 + 2 * dot), sine = std::sqrt(std::max(1 - h * h, 1e-12));
      turned += std::pow(sine, 1 / alpha);
    }
    sum += turned * width * sin_i / (1 + masked_o + masking(cos_i, alpha));
  }
  return sum * (2 + 1 / alpha) / (4 * cos_o * turns);  // phi: half the circle, twice
}

}  // namespace

std::vector<glm::vec2> sheen_albedo_table(ks::ThreadPool& workers) {
  std::vector<glm::vec2> table(sheen_albedo_entries);
  workers.parallel_for(sheen_albedo_roughnesses, [&](size_t r) {
    const double least = sheen_least_percent / 100.0, roughness = least + (1 - least) * double(r) / (sheen_albedo_roughnesses - 1);
    std::array<float, specular_albedo_size> row{};
    for (uint32_t c = 0; c < specular_albedo_size; ++c) {
      const double root = double(c) / (specular_albedo_size - 1);
      row[c] = float(albedo(root * root, roughness * roughness));
    }
    for (uint32_t c = 0; c < specular_albedo_size; ++c)
      table[r * specular_albedo_size + c] = {row[c], row[std::min(c + 1, specular_albedo_size - 1)]};
  });
  return table;
}

}  // namespace kuafu
