// The table that dims the base under a coat, against integrals done another way.
#include "material/specular_albedo.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "shared/scene_records.h"

namespace {

using std::numbers::pi;

// Walter et al. 2007 and Heitz 2014 over the hemisphere of outgoing directions, midpoint rule; reflectance f0 + (f90 - f0) (1 - oh)^5.
double albedo_by_hemisphere(double cosine, double roughness, double f0, double f90) {
  const double alpha = roughness * roughness;
  const auto lambda = [&](double c) { return (std::sqrt(1 + alpha * alpha * (1 / (c * c) - 1)) - 1) / 2; };
  const int n = 600;
  const double sine = std::sqrt(1 - cosine * cosine);
  double sum = 0;
  for (int i = 0; i < n; ++i)
    for (int j = 0; j < n; ++j) {
      const double c = (i + 0.5) / n, phi = 2 * pi * (j + 0.5) / n, s = std::sqrt(1 - c * c);
      const double hx = sine + s * std::cos(phi), hy = s * std::sin(phi), hz = cosine + c, length = std::sqrt(hx * hx + hy * hy + hz * hz);
      const double nh = hz / length, oh = (sine * hx + cosine * hz) / length;
      const double d = alpha * alpha / (pi * std::pow(nh * nh * (alpha * alpha - 1) + 1, 2));
      const double g = 1 / (1 + lambda(cosine) + lambda(c));
      sum += (f0 + (f90 - f0) * std::pow(1 - oh, 5)) * d * g / (4 * cosine);
    }
  return sum * 2 * pi / (double(n) * n);
}

TEST(SpecularAlbedo, equals_the_integral_over_the_hemisphere) {
  for (const double cosine : {0.2, 0.5, 0.9})
    for (const double roughness : {0.4, 0.7, 1.0}) {
      const glm::vec2 e = kuafu::specular_albedo(cosine, roughness);
      EXPECT_NEAR(0.04 * e.x + e.y, albedo_by_hemisphere(cosine, roughness, 0.04, 1.0), 0.004) << cosine << " " << roughness;
      EXPECT_NEAR(e.x + e.y, albedo_by_hemisphere(cosine, roughness, 1.0, 1.0), 0.01) << cosine << " " << roughness;
    }
}

TEST(SpecularAlbedo, is_fresnel_itself_where_smooth) {
  for (const double cosine : {0.1, 0.5, 1.0}) {
    const glm::vec2 e = kuafu::specular_albedo(cosine, 0.0);
    EXPECT_NEAR(e.x, 1 - std::pow(1 - cosine, 5), 1e-4);
    EXPECT_NEAR(e.y, std::pow(1 - cosine, 5), 1e-4);
  }
}

TEST(SpecularAlbedo, never_exceeds_one) {
  const auto table = kuafu::specular_albedo_table();
  ASSERT_EQ(table.size(), size_t(kuafu::specular_albedo_size) * (kuafu::specular_albedo_size + 1));
  for (const glm::vec2& e : table) EXPECT_LE(e.x + e.y, 1.0f + 1e-5f);
}

}  // namespace
