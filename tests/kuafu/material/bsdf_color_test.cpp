// SPDX-License-Identifier: Apache-2.0
// What differs between the channels of the visible band: thin films against Airy's sum over all waves, dispersion against Snell's law, on
// the shaders' text compiled as C++.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include "frame/host_language.h"

#define KUAFU_CHANNELS 3
namespace kuafu {
namespace {

constexpr uint features = ~0u;
#include "lib/dispersion.glsl"

using Rgb = std::array<double, 3>;

/// A Gaussian of the eye's sensitivity over wave numbers (1/um): Belcour and Barla 2017, table of the supplement.
double bell(double wave_number, double middle, double variance) {
  const double d = wave_number - middle;
  return std::exp(-d * d / (4 * variance)) / std::sqrt(4 * std::numbers::pi * variance);
}

/// Reflectance at normal incidence of a film over a base: Airy's sum of each wave, weighted by the eye, so that 1 is white.
Rgb seen(double ior, double thickness_um, double base) {
  const double r12 = (1 - ior) / (1 + ior), r23 = (ior - base) / (ior + base), step = 1e-4;
  double x = 0, y = 0, z = 0;
  for (double k = 0.8; k < 3.5; k += step) {
    const std::complex<double> turn = std::polar(1.0, 4 * std::numbers::pi * ior * thickness_um * k);
    const double airy = std::norm((r12 + r23 * turn) / (1.0 + r12 * r23 * turn)) * step;
    x += airy * (0.8462022 * bell(k, 1.6810, 4.3278e-3) + 0.1537978 * bell(k, 2.2399, 4.5282e-3));
    y += airy * bell(k, 1.7953, 9.3046e-3);
    z += airy * bell(k, 2.2084, 6.6121e-3);
  }
  const double rows[3][3] = {{3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
  Rgb rgb;
  for (size_t c = 0; c < 3; ++c)
    rgb[c] = std::clamp((rows[c][0] * x + rows[c][1] * y + rows[c][2] * z) / (rows[c][0] + rows[c][1] + rows[c][2]), 0.0, 1.0);
  return rgb;
}

TEST(ThinFilm, is_airys_sum_over_all_waves) {
  for (const double ior : {1.3, 1.8})
    for (const double thickness_nm : {80.0, 250.0, 420.0, 1000.0})
      for (const double base : {1.5, 3.0}) {
        const Rgb airy = seen(ior, thickness_nm * 1e-3, base);
        const auto f0 = float(std::pow((base - 1) / (base + 1), 2));
        const vec3 film = thin_film_reflectance({1, float(ior), float(thickness_nm)}, vec3(f0), 1);
        for (int c = 0; c < 3; ++c) EXPECT_NEAR(film[c], airy[size_t(c)], 2e-3) << ior << " " << thickness_nm << " " << base << " " << c;
      }
}

Glass prism(float ior, float dispersion, bool front) {
  MaterialPoint m{};
  m.base = vec3(1);
  m.transmission = m.specular = 1;
  m.ior = ior;
  m.dispersion = dispersion;
  m.carries = vec3(1);
  return make_glass(m, Vec2Array{}, 0.5f, front);
}

/// Abbe's definition, with Cauchy's two terms.
double cauchy(double ior, double dispersion, double wave_um) {
  const auto squared = [](double um) { return 1 / (um * um); };
  const double spread = (ior - 1) * dispersion / 20;
  return ior + spread * (squared(wave_um) - squared(0.5875618)) / (squared(0.4861327) - squared(0.6562725));
}

TEST(Dispersion, bends_each_channel_by_snell) {
  const double waves[] = {0.6114, 0.5491, 0.4643}, sine = 0.6;
  for (const bool front : {true, false}) {
    const Glass g = prism(1.6f, 0.8f, front);
    for (uint c = 0; c < 3; ++c) {
      const double n = cauchy(1.6, 0.8, waves[c]), eta = front ? 1 / n : n;
      Glass one = g;
      one.carries = vec3(0);
      one.carries[int(c)] = 1;
      const vec3 wo(float(sine), 0, float(std::sqrt(1 - sine * sine)));
      const Refraction r = refract_channel(one, wo, reflected_channels(one, wo.z), 0.5f);
      if (eta * sine >= 1) continue;
      EXPECT_NEAR(r.direction.x, -eta * sine, 2e-6) << front << " " << c;
      for (uint other = 0; other < 3; ++other) EXPECT_EQ(r.weight[int(other)] > 0, other == c);
    }
  }
}

// Mean of the weights over all draws: what each channel's boundary lets through, and none where it reflects all.
TEST(Dispersion, keeps_every_channels_energy) {
  for (const double sine : {0.0, 0.5, 0.63}) {  // at the last, inside, blue is reflected totally
    Glass g = prism(1.5f, 2, false);
    g.carries = vec3(0.5f, 1, 0.2f);
    const vec3 wo(float(sine), 0, float(std::sqrt(1 - sine * sine))), reflected = reflected_channels(g, wo.z);
    vec3 sum(0);
    constexpr int draws = 3000;
    for (int i = 0; i < draws; ++i) sum += refract_channel(g, wo, reflected, (float(i) + 0.5f) / draws).weight / float(draws);
    for (uint c = 0; c < 3; ++c) {
      const float eta = channel_eta(g.eta, g.dispersion, c);
      EXPECT_NEAR(sum[int(c)], (1 - reflected[int(c)]) * eta * eta, 2e-3f) << sine << " " << c;
    }
    EXPECT_EQ(reflected[2] == 1, sine * cauchy(1.5, 2, 0.4643) >= 1) << sine;
  }
}

}  // namespace
}  // namespace kuafu
