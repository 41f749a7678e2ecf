// SPDX-License-Identifier: Apache-2.0
// Laws of materials beyond Lambert and single scattering: energy, reciprocity, absorption, rough glass, and the paper's mix.
#include "kuafu/light_sampling.h"
#include "kuafu/material/measured.h"

namespace laws {
namespace {

kuafu_material_desc white_metal(float roughness) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.metallic = 1;
  m.roughness = roughness;
  return m;
}

TEST(Materials, a_white_metal_loses_nothing_at_any_roughness) {
  for (const float roughness : {0.1f, 0.3f, 0.6f, 1.0f})
    for (const double angle : {0.0, 0.8, 1.3})
      EXPECT_NEAR(in_furnace(white_metal(roughness), angle).mean(), 1, 0.01) << roughness << " " << angle;
}

TEST(Materials, no_material_creates_energy) {
  for (const float roughness : {0.05f, 0.4f, 1.0f})
    for (const float diffuse_roughness : {0.0f, 0.5f, 1.0f})
      for (const double angle : {0.0, 1.2}) {
        kuafu_material_desc m = kuafu_material_desc_init();
        m.roughness = roughness;
        m.diffuse_roughness = diffuse_roughness;
        const double coated = in_furnace(m, angle).mean();
        m.bsdf = KUAFU_BSDF_PAPER;
        m.metallic = 0.5f;
        const double mixed = in_furnace(m, angle).mean();
        for (const double mean : {coated, mixed}) {
          EXPECT_LT(mean, 1.01) << roughness << " " << diffuse_roughness << " " << angle;
          EXPECT_GT(mean, 0.6) << roughness << " " << diffuse_roughness << " " << angle;
        }
      }
}

TEST(Materials, every_reflection_is_reciprocal) {
  std::vector<kuafu_material_desc> materials{white_metal(0.4f), white_metal(0.9f)};
  for (const float roughness : {0.3f, 0.8f}) {
    kuafu_material_desc m = kuafu_material_desc_init();
    m.roughness = roughness;
    m.diffuse_roughness = roughness;
    materials.push_back(m);
    m.metallic = 0.4f;
    materials.push_back(m);
    m.transmission = 0.6f;
    m.transmission_roughness = 0.5f;
    materials.push_back(m);
    m.bsdf = KUAFU_BSDF_PAPER;
    materials.push_back(m);
  }
  for (size_t i = 0; i < materials.size(); ++i) {
    const double there = brdf(materials[i], 0.2, 0.9), back = brdf(materials[i], 0.9, 0.2);
    EXPECT_GT(there, 0) << i;
    EXPECT_NEAR(there / back, 1, 2e-3) << i;
  }
}

TEST(Materials, the_papers_mix_is_lambert_where_nothing_is_specular) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.bsdf = KUAFU_BSDF_PAPER;
  m.ir_albedo = 0.6f;
  for (const double angle : {0.1, 1.0}) EXPECT_NEAR(brdf(m, 0.3, angle), 0.6 / pi, 1e-4);
}

TEST(Materials, glass_absorbs_as_beer_and_lambert_say) {
  for (const double thickness : {0.1, 0.4}) {
    World world;
    kuafu_material_desc m = glass(1.0f);  // no reflection, no bending
    m.attenuation_color[0] = 0.5f;
    m.attenuation_distance_m = 0.2f;
    world.add(box({1, 1, thickness / 2}), m, placed({0, 0, 1}));
    world.set_environment(1.0f);
    world.desc().samples_per_pixel = 4;
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 4000)).mean(), std::pow(0.5, thickness / 0.2), 1e-3);
  }
}

TEST(Materials, a_lamp_behind_absorbing_glass_is_dimmed_the_same) {
  World world;
  kuafu_material_desc m = glass(1.0f);
  m.attenuation_color[0] = 0.5f;
  m.attenuation_distance_m = 0.2f;
  world.add(quad({0, 0, 1}, {-0.1, 0, 0}, {0, 0.1, 0}), lambert(1.0f));
  world.add_point({3, 0, 1 - 3}, 1.0f);
  world.desc().samples_per_pixel = 1;
  world.desc().max_bounces = 0;
  const kuafu_view_desc view = view_at({0, 0, 0}, 3, 3, 4000);
  const double open = world.radiance(view).at(0, 1, 1);
  world.add(box({0.1, 1, 1}), m, placed({1.5, 0, -0.5}));
  EXPECT_NEAR(world.radiance(view).at(0, 1, 1) / open, std::pow(0.5, std::sqrt(2.0) * 0.2 / 0.2), 1e-3);
}

kuafu_material_desc frosted(float roughness) {
  kuafu_material_desc m = glass(1.5f);
  m.transmission_roughness = roughness;
  return m;
}

// A block that fills the view, at an angle: paths leave it by all of its faces.
double frosted_in_furnace(float ior, float roughness, uint32_t tracer = KUAFU_TRACER_AUTO, uint32_t side = 20) {
  World world(tracer);
  kuafu_material_desc m = frosted(roughness);
  m.ior = ior;
  world.add(box({1, 1, 0.3}), m, placed({0, 0, 2}, 0.7));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = 256;
  world.desc().max_bounces = 100;
  return world.radiance(view_at({0, 0, 0}, side, side, 3 * side)).mean();
}

TEST(Materials, rough_glass_loses_and_creates_nothing) {
  for (const auto& [ior, roughness] : {std::pair{1.1f, 1.0f}, {1.5f, 0.1f}, {1.5f, 0.6f}, {2.0f, 0.4f}})
    EXPECT_NEAR(frosted_in_furnace(ior, roughness), 1, 0.01) << ior << " " << roughness;
  EXPECT_NEAR(frosted_in_furnace(1.5f, 0.8f, KUAFU_TRACER_COMPUTE, 12), 1, 0.02);
}

TEST(Materials, nearly_smooth_glass_is_smooth_glass) {
  double means[2];
  for (const bool rough : {false, true}) {
    World world;
    world.add(box({5, 5, 0.01}), rough ? frosted(0.04f) : glass(1.5f), placed({0, 0, 1}, 0.8));
    world.add(quad({0, 0, 20}, {-6, 0, 0}, {0, 6, 0}), emitter(1.0f));
    world.desc().samples_per_pixel = 512;
    world.desc().max_bounces = 20;
    means[rough] = world.radiance(view_at({0, 0, 0}, 8, 8, 4000)).mean();
  }
  EXPECT_NEAR(means[1] / means[0], 1, 0.01);
}

TEST(Materials, light_samples_and_bsdf_samples_agree_through_rough_glass) {
  expect_samplings_agree_through(box({1, 1, 0.05}), frosted(0.5f), 4096, 6);
}

}  // namespace
}  // namespace laws
