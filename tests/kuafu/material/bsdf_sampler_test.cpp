// SPDX-License-Identifier: Apache-2.0
// The BSDF's sampler against its own density and value, on the shaders' text compiled as C++: chi-square, and weight = f cos / pdf.
#include <gtest/gtest.h>

#include <complex>
#include <random>
#include <vector>

#include "frame/host_language.h"
#include "kuafu/material/chi_square.h"
#include "material/albedo_tables.h"

#define KUAFU_CHANNELS 1
namespace kuafu {
namespace {

constexpr uint features = ~0u;
#include "lib/bsdf.glsl"

using test::ChiSquare;
using test::direction;

const std::vector<glm::vec2>& table() {
  static ks::ThreadPool workers(1);
  static const std::vector<glm::vec2> values = albedo_tables(workers, true, true);
  return values;
}

MaterialPoint point(float metallic, float transmission, float roughness, float transmission_roughness) {
  MaterialPoint m{};
  m.base = 0.7f;
  m.carries = 1.0f;
  m.clearcoat_normal = vec3(0, 0, 1);
  m.metallic = metallic;
  m.transmission = transmission;
  m.roughness = roughness;
  m.transmission_roughness = transmission_roughness;
  m.specular = m.coat = 1.0f;
  m.diffuse_roughness = 0.4f;
  m.ior = 1.5f;
  return m;
}

struct Lobe {
  Bsdf bsdf;
  vec3 wo, chances;
  Vec2Array albedo;
};

Lobe lobe(const MaterialPoint& m, double angle, bool front, double azimuth = 0.3) {
  Lobe l;
  l.albedo.at = table().data();
  l.wo = direction(std::cos(angle), azimuth);
  l.bsdf = make_bsdf(m, l.albedo, l.wo, front);
  l.chances = lobe_chances(l.bsdf);
  return l;
}

void check(const MaterialPoint& m, double angle, bool front) {
  const Lobe l = lobe(m, angle, front);
  ChiSquare drawn;
  std::mt19937 random(7);
  std::uniform_real_distribution<float> unit(0.0f, 0.9999999f);
  for (int i = 0; i < ChiSquare::samples; ++i) {
    const vec2 u(unit(random), unit(random));
    const BsdfSample s = bsdf_sample(l.bsdf, l.albedo, l.wo, l.chances, u, unit(random));
    if (s.pdf <= 0.0f) continue;
    ASSERT_NEAR(length(s.direction), 1.0f, 1e-3f);
    float density;
    const float f = bsdf_evaluate(l.bsdf, l.albedo, l.wo, s.direction, l.chances, density);
    ASSERT_NEAR(s.weight * density, f, 1e-4f * std::max(1.0f, f));
    drawn.count(s.direction);
  }
  const auto density_of = [&](const vec3& d) {
    float density;
    bsdf_evaluate(l.bsdf, l.albedo, l.wo, d, l.chances, density);
    return double(density);
  };
  drawn.expect(density_of, 1e-4);
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

TEST(BsdfSampler, a_rough_sheet) {
  MaterialPoint m = point(0, 1, 0.5f, 0.6f);
  m.thin_walled = true;
  for (const bool front : {true, false})
    for (const double angle : {0.2, 1.1}) check(m, angle, front);
}

TEST(BsdfSampler, everything_at_once) { check(point(0.3f, 0.4f, 0.6f, 0.7f), 0.9, true); }

MaterialPoint coated(MaterialPoint m, float weight, float roughness) {
  m.clearcoat = weight;
  m.clearcoat_roughness = roughness;
  return m;
}

TEST(BsdfSampler, a_clear_coat_with_normals_of_its_own) {
  MaterialPoint m = coated(point(0.5f, 0, 0.4f, 0), 0.8f, 0.3f);
  m.clearcoat_normal = direction(std::cos(0.4), 2);
  check(m, 0.7, true);
}

TEST(BsdfSampler, a_clear_coat) {
  check(coated(point(0.5f, 0, 0.4f, 0), 0.8f, 0.3f), 1.0, true);
  check(coated(point(0.3f, 0.4f, 0.6f, 0.7f), 1, 0.5f), 0.6, true);
}

MaterialPoint translucent(MaterialPoint m, float share, float color) {
  m.diffuse_transmission = share;
  m.beyond = color;
  m.thin_walled = true;
  return m;
}

TEST(BsdfSampler, light_that_is_let_through) {
  check(translucent(point(0.2f, 0, 0.4f, 0), 0.6f, 0.8f), 1.0, true);
  check(translucent(coated(point(0.2f, 0.5f, 0.6f, 0.7f), 0.5f, 0.3f), 0.5f, 0.4f), 0.6, false);
}

MaterialPoint brushed(MaterialPoint m, float anisotropy) {
  m.anisotropy = anisotropy;
  return m;
}

TEST(BsdfSampler, lobes_that_are_drawn_out) {
  for (const double angle : {0.2, 1.2}) check(brushed(point(1, 0, 0.4f, 0), 0.6f), angle, true);
  check(brushed(coated(point(0.3f, 0.4f, 0.6f, 0.7f), 1, 0.5f), 1), 0.7, true);
}

MaterialPoint fluffy(MaterialPoint m, float color, float roughness) {
  m.sheen = color;
  m.sheen_roughness = roughness;
  return m;
}

TEST(BsdfSampler, fibres) {
  check(fluffy(point(0, 0, 0.5f, 0), 0.8f, 0.3f), 1.2, true);
  check(fluffy(translucent(coated(point(0.3f, 0.4f, 0.6f, 0.7f), 1, 0.5f), 0.5f, 0.4f), 1, 0.6f), 0.6, true);
}

MaterialPoint filmed(MaterialPoint m, float weight, float ior, float thickness_nm) {
  m.iridescence = weight;
  m.iridescence_ior = ior;
  m.thin_film_nm = thickness_nm;
  return m;
}

TEST(BsdfSampler, a_film) {
  check(filmed(point(0.4f, 0, 0.5f, 0), 0.9f, 1.8f, 500), 0.8, true);
  for (const bool front : {true, false}) check(filmed(point(0.2f, 0.6f, 0.5f, 0.6f), 1, 2, 300), 0.8, front);
}

/// Energy that clear glass gives of light from one direction, by its sampler; radiance changes by eta squared besides.
double energy(const MaterialPoint& m, double cosine, bool front, double azimuth = 0.3) {
  const Lobe l = lobe(m, std::acos(cosine), front, azimuth);
  constexpr int points = 16384;  // of a low-discrepancy sequence: multiples of the powers of x^4 = x + 1's root
  const auto fraction = [](double x) { return float(x - std::floor(x)); };
  double sum = 0;
  for (int i = 0; i < points; ++i) {
    const vec2 u(fraction(0.5 + i * 0.8191725134), fraction(0.5 + i * 0.6710436067));
    const BsdfSample s = bsdf_sample(l.bsdf, l.albedo, l.wo, l.chances, u, fraction(0.5 + i * 0.5497004779));
    sum += double(s.weight) / (s.transmitted && !m.thin_walled ? double(l.bsdf.glass.eta * l.bsdf.glass.eta) : 1.0);
  }
  return sum / points;
}

TEST(Glass, that_is_rough_loses_and_creates_nothing) {
  for (const float ior : {1.1f, 1.33f, 1.5f, 1.75f, 2.0f})
    for (const float roughness : {0.1f, 0.25f, 0.45f, 0.6f, 0.8f, 1.0f})
      for (const float specular : {0.4f, 1.0f})
        for (const bool front : {true, false})
          for (const double cosine : {0.2, 0.4, 0.6, 0.8, 1.0}) {
            MaterialPoint m = point(0, 1, 1, roughness);
            m.base = 1;
            m.ior = ior;
            m.specular = specular;
            EXPECT_NEAR(energy(m, cosine, front), 1, 0.01)
                << ior << " roughness " << roughness << " specular " << specular << (front ? " outside " : " inside ") << cosine;
          }
}

TEST(Glass, that_is_a_rough_sheet_loses_and_creates_nothing) {
  for (const float roughness : {0.1f, 0.45f, 0.8f, 1.0f})
    for (const bool front : {true, false})
      for (const double cosine : {0.1, 0.3, 0.55, 1.0}) {
        MaterialPoint m = point(0, 1, 1, roughness);
        m.base = 1;
        m.thin_walled = true;
        EXPECT_NEAR(energy(m, cosine, front), 1, 0.01) << roughness << " " << cosine;
        m.base = 0.5f;
        EXPECT_LT(energy(m, cosine, front), 1);
      }
}

/// A white surface gives between `least` and `most` of the light of one direction.
void expect_white_between(MaterialPoint m, double cosine, double least, double most, const std::string& what, double azimuth = 0.3) {
  m.base = 1;
  m.diffuse_roughness = 0;
  const double e = energy(m, cosine, true, azimuth);
  EXPECT_GT(e, least) << what << ", roughness " << m.roughness << ", metallic " << m.metallic << ", cosine " << cosine;
  EXPECT_LT(e, most) << what << ", roughness " << m.roughness << ", metallic " << m.metallic << ", cosine " << cosine;
}

// What lies over rough metal takes the larger of the coat's two albedos from it, so that some is lost there.
TEST(Clearcoat, over_white_surfaces_creates_nothing_and_loses_little) {
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : {0.0f, 0.5f, 1.0f})
      for (const float coat : {0.0f, 0.3f, 1.0f})
        for (const double cosine : {0.15, 0.4, 1.0})
          expect_white_between(coated(point(metallic, 0, roughness, 0), 1, coat), cosine, metallic * roughness > 0 ? 0.95 : 0.985, 1.01,
                               "coat " + std::to_string(coat));
}

/// f of glass from wo to wi, each on its side of the surface; radiance over the squared index of where it is, as reciprocity has it.
double reciprocal_f(const MaterialPoint& m, vec3 wo, vec3 wi) {
  const bool front = wo.z > 0, turned = !front;
  const vec3 side = turned ? vec3(-1.0f) : vec3(1.0f);
  Vec2Array albedo;
  albedo.at = table().data();
  const Bsdf b = make_bsdf(m, albedo, wo * side, front);
  float density;
  const float f = bsdf_evaluate(b, albedo, wo * side, wi * side, lobe_chances(b), density) / std::abs(wi.z);
  return double(f) / (front || m.thin_walled ? 1.0 : double(m.ior * m.ior));
}

TEST(Glass, is_reciprocal) {
  for (const bool thin : {false, true})
    for (const float ior : {1.1f, 1.5f, 2.0f})
      for (const float roughness : {0.3f, 0.7f, 1.0f}) {
        MaterialPoint m = point(0, 1, 1, roughness);
        m.ior = ior;
        m.thin_walled = thin;
        const vec3 ways[] = {direction(0.9, 0), direction(0.3, 2), direction(-0.95, 1), direction(-0.5, 3)};
        for (const vec3& a : ways)
          for (const vec3& b : ways) {
            const double there = reciprocal_f(m, a, b), back = reciprocal_f(m, b, a);
            EXPECT_GT(there, 0);
            EXPECT_NEAR(there / back, 1, 2e-3) << thin << " " << ior << " " << roughness << " " << a.z << " " << b.z;
          }
      }
}

TEST(DiffuseTransmission, of_white_paper_loses_and_creates_nothing) {
  for (const float coat : {0.0f, 1.0f})
    for (const float share : {0.3f, 1.0f})
      for (const bool front : {true, false})
        for (const double cosine : {0.15, 0.5, 1.0}) {
          MaterialPoint m = translucent(coated(point(0, 0, 0.5f, 0), coat, 0.4f), share, 1);
          m.base = 1;
          m.diffuse_roughness = 0;
          EXPECT_NEAR(energy(m, cosine, front), 1, coat > 0 ? 0.015 : 0.01) << "share " << share << ", coat " << coat << ", " << cosine;
        }
}

TEST(Anisotropy, of_white_surfaces_creates_little_and_loses_little) {
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : {0.0f, 0.2f, 0.3f, 0.7f})
      for (const float anisotropy : {0.3f, 0.5f, 0.7f, 1.0f})
        for (const double cosine : {0.15, 0.4, 1.0})
          for (const double azimuth : {0.0, 0.3, 0.8, 1.5708})
            expect_white_between(brushed(point(metallic, 0, roughness, 0), anisotropy), cosine, 0.93, 1.015,
                                 "anisotropy " + std::to_string(anisotropy), azimuth);
}

TEST(Anisotropy, of_nearly_nothing_is_the_round_lobe) {
  Vec2Array albedo;
  albedo.at = table().data();
  const vec3 wo = direction(0.6, 0.3), wi = direction(0.5, 2);
  for (const float metallic : {0.0f, 1.0f}) {
    const MaterialPoint round = point(metallic, 0, 0.4f, 0);
    const Bsdf a = make_bsdf(round, albedo, wo, true), b = make_bsdf(brushed(round, 0.01f), albedo, wo, true);
    ASSERT_NE(b.alphas.x, b.alphas.y);
    float pdf_a, pdf_b;
    const double f_a = double(bsdf_evaluate(a, albedo, wo, wi, lobe_chances(a), pdf_a));
    EXPECT_NEAR(double(bsdf_evaluate(b, albedo, wo, wi, lobe_chances(b), pdf_b)) / f_a, 1, 2e-3);
    EXPECT_NEAR(double(pdf_b / pdf_a), 1, 2e-3);
  }
}

// Facets tilt along x: the lobe there is that of alpha mix(alpha, 1, 0.25), at the mirrored direction 1 / (4 pi alpha_x alpha_y).
TEST(Anisotropy, draws_the_lobe_out_along_x) {
  Vec2Array albedo;
  albedo.at = table().data();
  const vec3 up = direction(1, 0), along = direction(std::cos(0.4), 0), across = direction(std::cos(0.4), double(pi) / 2);
  const Bsdf b = make_bsdf(brushed(point(1, 0, 0.4f, 0), 0.5f), albedo, up, true);
  const float x = 0.16f + 0.84f * 0.25f;
  EXPECT_FLOAT_EQ(b.alphas.x, x);
  EXPECT_FLOAT_EQ(b.alphas.y, 0.16f);
  float pdf;
  EXPECT_NEAR(bsdf_evaluate(b, albedo, up, up, lobe_chances(b), pdf), 0.7f / (4 * pi * x * 0.16f), 0.05f);
  EXPECT_GT(bsdf_evaluate(b, albedo, up, along, lobe_chances(b), pdf), 2 * bsdf_evaluate(b, albedo, up, across, lobe_chances(b), pdf));
}

// The larger of two albedos is taken from what lies below.
TEST(Sheen, over_white_surfaces_creates_nothing_and_loses_little) {
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : {0.1f, 0.3f, 0.6f, 1.0f})
      for (const double cosine : {0.1, 0.3, 0.6, 1.0})
        expect_white_between(fluffy(point(metallic, 0, 0.5f, 0), 1, roughness), cosine, 0.6, 1.015, "fibres " + std::to_string(roughness));
}

TEST(Sheen, over_black_has_the_albedo_of_its_table) {
  Vec2Array albedo;
  albedo.at = table().data();
  for (const float roughness : {0.07f, 0.2f, 0.5f, 1.0f})
    for (const double cosine : {0.1, 0.3, 0.6, 1.0}) {
      MaterialPoint m = fluffy(point(0, 0, 0.5f, 0), 1, roughness);
      m.base = m.specular = m.coat = 0;
      const double e = double(sheen_albedo(albedo, roughness, float(cosine)));
      EXPECT_NEAR(energy(m, cosine, true), std::min(e, 1.0), 0.01 + 0.1 * e) << roughness << " " << cosine;
    }
}

TEST(Iridescence, of_white_surfaces_creates_nothing) {
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : {0.0f, 0.4f, 1.0f})
      for (const float ior : {1.3f, 2.0f})
        for (const float thickness_nm : {150.0f, 400.0f, 900.0f})
          for (const double cosine : {0.15, 0.5, 1.0})
            expect_white_between(filmed(point(metallic, 0, roughness, 0), 1, ior, thickness_nm), cosine, 0.88, 1.02,
                                 "film " + std::to_string(ior) + ", " + std::to_string(thickness_nm));
}

TEST(Iridescence, of_clear_glass_loses_nothing) {
  for (const bool thin : {false, true})
    for (const bool front : {true, false})
      for (const double cosine : {0.2, 0.7, 1.0}) {
        MaterialPoint m = filmed(point(0, 1, 0.5f, 0), 1, 1.8f, 350);
        m.base = 1;
        m.thin_walled = thin;
        EXPECT_NEAR(energy(m, cosine, front), 1, 1e-3) << thin << front << cosine;
      }
}

// Airy's sum of complex amplitudes, in double precision, at normal incidence and 850 nm.
TEST(Iridescence, in_infrared_is_airys_sum) {
  for (const double ior : {1.3, 1.7, 2.4})
    for (const double thickness_nm : {0.0, 60.0, 212.5, 400.0, 1100.0})
      for (const double base : {1.5, 4.0}) {
        const double r12 = (1 - ior) / (1 + ior), r23 = (ior - base) / (ior + base);
        const std::complex<double> turn = std::polar(1.0, 4 * double(pi) * ior * thickness_nm / 850);
        const double airy = std::norm((r12 + r23 * turn) / (1.0 + r12 * r23 * turn)), f0 = std::pow((base - 1) / (base + 1), 2);
        EXPECT_NEAR(thin_film_reflectance({1, float(ior), float(thickness_nm)}, float(f0), 1), airy, 2e-5)
            << ior << " " << thickness_nm << " " << base;
      }
}

TEST(Lobes, are_reciprocal) {
  const vec3 above = direction(0.9, 0), aslant = direction(0.3, 2), grazing = direction(0.1, 2), below = direction(-0.3, 2);
  const MaterialPoint dull = point(0.5f, 0, 0.5f, 0);
  std::vector<std::tuple<const char*, vec3, MaterialPoint>> lobes = {
      {"let through", below, translucent(coated(point(0.2f, 0, 0.5f, 0), 0.7f, 0.2f), 0.6f, 0.8f)},
      {"drawn out", aslant, brushed(point(0.5f, 0, 0.4f, 0), 0.8f)},
      {"fibres", grazing, fluffy(coated(dull, 0.5f, 0.3f), 0.7f, 0.1f)},
      {"rough fibres", grazing, fluffy(coated(dull, 0.5f, 0.3f), 0.7f, 0.5f)},
      {"film", aslant, filmed(dull, 0.8f, 1.5f, 450)}};
  for (const float metallic : {0.0f, 1.0f})
    for (const float coat : {0.2f, 0.8f}) lobes.emplace_back("coat", aslant, coated(point(metallic, 0.2f, 0.5f, 0.5f), 0.7f, coat));
  for (const auto& [name, other, m] : lobes) EXPECT_NEAR(reciprocal_f(m, above, other) / reciprocal_f(m, other, above), 1, 2e-3) << name;
}

}  // namespace
}  // namespace kuafu
