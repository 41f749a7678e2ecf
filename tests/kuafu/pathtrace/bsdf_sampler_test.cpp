// The BSDF's sampler against its own density and value, on the shaders' text compiled as C++: chi-square over the sphere, and weight = f
// cos / pdf.
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "material/specular_albedo.h"
#include "pathtrace/host_language.h"

#define KUAFU_CHANNELS 1
namespace kuafu {
namespace {

constexpr uint features = ~0u;
#include "lib/bsdf.glsl"

constexpr int rows = 24, columns = 16, samples = 200000, sub = 24;

const std::vector<glm::vec2>& table() {
  static ks::ThreadPool workers(1);
  static const std::vector<glm::vec2> values = specular_albedo_table(workers);
  return values;
}

MaterialPoint point(float metallic, float transmission, float roughness, float transmission_roughness) {
  MaterialPoint m{};
  m.base = 0.7f;
  m.metallic = metallic;
  m.transmission = transmission;
  m.roughness = roughness;
  m.transmission_roughness = transmission_roughness;
  m.specular = m.coat = 1.0f;
  m.diffuse_roughness = 0.4f;
  m.ior = 1.5f;
  return m;
}

vec3 direction(double cosine, double phi) {
  const double s = std::sqrt(std::max(0.0, 1 - cosine * cosine));
  return {float(s * std::cos(phi)), float(s * std::sin(phi)), float(cosine)};
}

struct Lobe {
  Bsdf bsdf;
  vec3 wo, chances;
  Vec2Array albedo;
};

Lobe lobe(const MaterialPoint& m, double angle, bool front) {
  Lobe l;
  l.albedo.at = table().data();
  l.wo = direction(std::cos(angle), 0.3);
  l.bsdf = make_bsdf(m, l.albedo, l.wo.z, front);
  l.chances = lobe_chances(l.bsdf);
  return l;
}

std::vector<double> expected_counts(const Lobe& l) {
  std::vector<double> counts(size_t(rows) * columns);
  const double cell = 2.0 / (rows * sub) * 2 * double(pi) / (columns * sub);
  for (int r = 0; r < rows * sub; ++r)
    for (int c = 0; c < columns * sub; ++c) {
      float density;
      bsdf_evaluate(l.bsdf, l.albedo, l.wo, direction(-1 + 2 * (r + 0.5) / (rows * sub), 2 * double(pi) * (c + 0.5) / (columns * sub)),
                    l.chances, density);
      counts[size_t(r / sub) * columns + size_t(c / sub)] += samples * cell * double(density);
    }
  return counts;
}

void check(const MaterialPoint& m, double angle, bool front) {
  const Lobe l = lobe(m, angle, front);
  std::vector<double> counts(size_t(rows) * columns);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0.0f, 0.9999999f);
  for (int i = 0; i < samples; ++i) {
    const vec2 u(unit(random), unit(random));
    const BsdfSample s = bsdf_sample(l.bsdf, l.albedo, l.wo, l.chances, u, unit(random));
    if (s.pdf <= 0.0f) continue;
    ASSERT_NEAR(length(s.direction), 1.0f, 1e-3f);
    float density;
    const float f = bsdf_evaluate(l.bsdf, l.albedo, l.wo, s.direction, l.chances, density);
    ASSERT_NEAR(s.weight * density, f, 1e-4f * std::max(1.0f, f));
    double phi = std::atan2(s.direction.y, s.direction.x);
    if (phi < 0) phi += 2 * double(pi);
    const int row = std::min(rows - 1, int((s.direction.z + 1) / 2 * rows)),
              column = std::min(columns - 1, int(phi / (2 * double(pi)) * columns));
    counts[size_t(row) * columns + size_t(column)] += 1;
  }
  double chi_square = 0, rest_counted = 0, rest_expected = 0;
  int cells = 0;
  const std::vector<double> expected = expected_counts(l);
  for (size_t i = 0; i < counts.size(); ++i) {
    if (expected[i] < 10) {
      rest_counted += counts[i], rest_expected += expected[i];
      continue;
    }
    chi_square += (counts[i] - expected[i]) * (counts[i] - expected[i]) / expected[i];
    ++cells;
  }
  // Five standard deviations of chi-square, and 1 % for the quadrature of narrow lobes.
  EXPECT_LT(chi_square, cells + 5 * std::sqrt(2.0 * cells) + 1e-4 * samples) << cells << " cells";
  EXPECT_LT(std::abs(rest_counted - rest_expected), 5 * std::sqrt(rest_expected + 10) + 2e-3 * samples);
}

TEST(BsdfSampler, diffuse_under_a_coat) {
  for (const double angle : {0.2, 1.2}) check(point(0, 0, 0.5f, 0), angle, true);
}

TEST(BsdfSampler, rough_metal) {
  for (const float roughness : {0.4f, 1.0f}) check(point(1, 0, roughness, 0), 0.8, true);
}

TEST(BsdfSampler, rough_glass_from_both_sides) {
  for (const bool front : {true, false})
    for (const float roughness : {0.5f, 0.9f}) check(point(0, 1, 0.5f, roughness), 0.6, front);
}

TEST(BsdfSampler, everything_at_once) { check(point(0.3f, 0.4f, 0.6f, 0.7f), 0.9, true); }

}  // namespace
}  // namespace kuafu
