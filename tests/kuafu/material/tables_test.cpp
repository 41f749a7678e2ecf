// SPDX-License-Identifier: Apache-2.0
// Tables and textures on their way to the device: the albedo under a coat against integrals done another way, texels as they are decoded.
#include <gtest/gtest.h>
#include <glm/gtc/packing.hpp>

#include <cmath>
#include <cstring>
#include <numbers>

#include "material/albedo_tables.h"
#include "material/texels.h"
#include "shared/scene_records.h"

namespace {

using std::numbers::pi;

// Walter et al. 2007 and Heitz 2014 over the hemisphere of outgoing directions, midpoint rule.
template <class Reflectance>
double albedo_by_hemisphere(double cosine, double roughness, const Reflectance& reflectance) {
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
      sum += reflectance(oh) * d * g / (4 * cosine);
    }
  return sum * 2 * pi / (double(n) * n);
}

double albedo_by_hemisphere(double cosine, double roughness, double f0, double f90) {
  return albedo_by_hemisphere(cosine, roughness, [&](double oh) { return f0 + (f90 - f0) * std::pow(1 - oh, 5); });
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

double fresnel(double cosine, double ior) {  // Hecht, Optics, 4.6
  const double t = std::sqrt(1 - (1 - cosine * cosine) / (ior * ior));
  return (std::pow((cosine - ior * t) / (cosine + ior * t), 2) + std::pow((ior * cosine - t) / (ior * cosine + t), 2)) / 2;
}

// Single scattering of the layer by quadrature over the hemisphere, and what several facets add by Kulla and Conty's formula.
TEST(SpecularAlbedo, of_the_layer_is_the_integral_of_its_lobes) {
  ks::ThreadPool workers(2);
  const auto table = kuafu::specular_albedo_table(workers);
  ASSERT_EQ(table.size(), size_t(kuafu::specular_albedo_entries));
  constexpr uint32_t last = kuafu::layer_albedo_size - 1, cosines = kuafu::specular_albedo_size;
  for (const uint32_t i : {3u, 5u})  // ior 1.5 and 2
    for (const uint32_t r : {6u, 10u, 15u}) {
      const double root_f0 = double(i) / last, ior = (1 + root_f0) / (1 - root_f0), roughness = double(r) / last;
      const glm::vec2* row = &table[kuafu::layer_albedo_first + (i * kuafu::layer_albedo_size + r) * cosines];
      double lossless_mean = 0;
      for (int k = 0; k < 32; ++k) {
        const double c = (k + 0.5) / 32;
        const glm::vec2 e = kuafu::specular_albedo(c, roughness);
        lossless_mean += 2 * c / 32 * double(e.x + e.y);
      }
      double mean = 0;
      for (int k = 0; k < 2000; ++k) mean += 2 * (k + 0.5) / 2000 / 2000 * fresnel((k + 0.5) / 2000, ior);
      EXPECT_NEAR(kuafu::layer_fresnel_mean(ior), mean, 0.005) << ior;
      const double share = mean * mean * lossless_mean / (1 - mean * (1 - lossless_mean));
      for (const uint32_t c : {8u, 20u, 30u}) {
        const double cosine = double(c) / (cosines - 1);
        const glm::vec2 e = kuafu::specular_albedo(cosine, roughness);
        const double expected =
            albedo_by_hemisphere(cosine, roughness, [&](double oh) { return fresnel(oh, ior); }) + share * (1 - double(e.x + e.y));
        EXPECT_NEAR(row[c].x, expected, 0.004) << ior << " " << roughness << " " << cosine;
        EXPECT_EQ(row[c - 1].y, row[c].x);
      }
    }
}

TEST(SpecularAlbedo, never_exceeds_one) {
  ks::ThreadPool workers(2);
  const auto table = kuafu::specular_albedo_table(workers);
  for (uint32_t i = 0; i < kuafu::layer_albedo_first; ++i) EXPECT_LE(table[i].x + table[i].y, 1.0f + 1e-5f);
  for (size_t i = kuafu::layer_albedo_first; i < table.size(); ++i) EXPECT_LE(table[i].x, 1.0f + 1e-4f) << i;
}

kuafu::Texture texture(uint32_t channels, bool srgb, std::vector<uint8_t> texels) {
  kuafu::Texture t;
  t.channels = channels;
  t.srgb = srgb;
  t.width = uint32_t(texels.size() / channels);
  t.height = 1;
  t.texels = std::move(texels);
  return t;
}

glm::vec4 half4(const kuafu::Texels& t, size_t i) { return {glm::unpackHalf2x16(t.words[2 * i]), glm::unpackHalf2x16(t.words[2 * i + 1])}; }

TEST(Texels, srgb_is_decoded_and_alpha_is_not) {
  const kuafu::Texels t = kuafu::linear_texels(texture(4, true, {0, 128, 255, 128}));
  ASSERT_EQ(t.format, kuafu::texel_half4);
  const glm::vec4 rgba = half4(t, 0);
  EXPECT_EQ(rgba.r, 0.0f);
  EXPECT_NEAR(rgba.g, 0.21586, 2e-4);  // IEC 61966-2-1 of 128 / 255
  EXPECT_EQ(rgba.b, 1.0f);
  EXPECT_NEAR(rgba.a, 128 / 255.0, 5e-4);
}

TEST(Texels, one_channel_is_grey_and_two_are_grey_and_alpha) {
  EXPECT_NEAR(half4(kuafu::linear_texels(texture(1, false, {51})), 0).b, 0.2, 2e-4);
  const glm::vec4 rgba = half4(kuafu::linear_texels(texture(2, false, {51, 102})), 0);
  EXPECT_NEAR(rgba.g, 0.2, 2e-4);
  EXPECT_NEAR(rgba.a, 0.4, 4e-4);
}

TEST(Texels, floats_stay_exact) {
  kuafu::Texture t;
  t.format = kuafu::Texture::Format::f32;
  t.width = t.height = 1;
  t.channels = 3;
  const float values[3] = {1e6f, 0.1f, 3e-9f};
  t.texels.resize(sizeof values);
  std::memcpy(t.texels.data(), values, sizeof values);
  const kuafu::Texels out = kuafu::linear_texels(t);
  ASSERT_EQ(out.format, kuafu::texel_float4);
  EXPECT_EQ(std::memcmp(out.words.data(), values, sizeof values), 0);
}

TEST(Texels, a_pattern_is_red_as_stored) {
  const kuafu::PatternPlane plane = kuafu::pattern_plane(texture(3, true, {128, 1, 2, 255, 3, 4}));
  EXPECT_EQ(plane.bits, 8u);
  ASSERT_EQ(plane.words.size(), 1u);
  EXPECT_EQ(plane.words[0], 128u | 255u << 8);
}

}  // namespace
