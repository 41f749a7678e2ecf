// SPDX-License-Identifier: Apache-2.0
// Furnaces: energy of every material, and what a mix of lobes is.
#include "kuafu/material/measured.h"

namespace laws {
namespace {

TEST(Furnace, a_lambertian_plane_shows_albedo_times_environment) {
  for (const float albedo : {0.0f, 0.18f, 1.0f})
    for (const float v : in_furnace(lambert(albedo), 0.7, 64).values) ASSERT_NEAR(v, albedo, 1e-4);
}

TEST(Furnace, clear_glass_vanishes) {
  World world;
  world.add(sphere(0.5, 16, false), glass(1.5f), placed({0, 0, 2}));
  world.set_environment(1.0f);
  const Pixels image = world.radiance(view_at({0, 0, 0}, 32, 32, 60), 64, 64);
  EXPECT_NEAR(image.mean(), 1.0, 0.01);
  for (const float v : image.values) ASSERT_LT(v, 2.3f);  // n^2 at most: a path that ends inside
  World smooth;                                           // normals between those of the corners
  smooth.add(sphere(0.5, 48, true), glass(1.5f), placed({0, 0, 2}));
  smooth.set_environment(1.0f);
  EXPECT_NEAR(smooth.radiance(view_at({0, 0, 0}, 48, 48, 90), 16, 32).mean(), 1.0, 0.01);
}

// Closed room of albedo rho whose walls shine with E: L = E + rho L. The bright environment outside must not leak in.
TEST(Furnace, a_shining_room_is_the_geometric_series) {
  for (const float rho : {0.3f, 0.7f}) {
    World world;
    kuafu_material_desc wall = emitter(1.0f);
    for (int i = 0; i < 3; ++i) wall.base_color[i] = rho;
    world.add(box({1, 1, 1}), wall);
    world.set_environment(1e4f);
    const double expected = 1 / (1 - rho);
    EXPECT_NEAR(world.radiance(view_at({0.2, 0.1, -0.3}, 32, 32, 20), 64, 100).mean(), expected, 0.005 * expected);
  }
}

TEST(Furnace, bounces_count_surfaces_after_the_first) {
  World world;
  kuafu_material_desc wall = emitter(1.0f);
  for (int i = 0; i < 3; ++i) wall.base_color[i] = 0.5f;
  world.add(box({1, 1, 1}), wall);
  world.desc().light_sampling = KUAFU_SAMPLING_BSDF;  // then nothing is left to chance
  for (const uint32_t bounces : {0u, 1u, 2u}) {
    world.desc().max_bounces = bounces;
    // Emission seen, and the direct light of the walls on each of bounces + 1 surfaces.
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 10)).mean(), 2 - std::pow(0.5, bounces + 1), 1e-4) << bounces;
  }
}

// 0.1 mm to 10 m, far from and near the origin: a shut box in a bright environment stays dark, and a lit plane has no acne.
TEST(Furnace, no_light_leaks_and_no_acne_at_any_scale) {
  for (const double scale : {1e-4, 1e-2, 1.0, 10.0}) {
    World world;
    world.add(box({1, 1, 1}), lambert(0.9f), placed({3 * scale, 0, scale}, 0.3, scale));
    world.set_environment(1.0f);
    kuafu_view_desc view = view_at({3 * scale, 0, scale}, 32, 32, 12);
    EXPECT_EQ(world.radiance(view).mean(), 0.0) << scale;

    World open;
    open.add(sphere(1, 32, false), lambert(1.0f), placed({3 * scale, 0, 4 * scale}, 0.2, scale));
    open.set_environment(1.0f);
    EXPECT_NEAR(open.radiance(view_at({3 * scale, 0, 0}, 32, 32, 40)).mean(), 1.0, 1e-3) << scale;
  }
}

TEST(Materials, a_white_metal_loses_nothing_at_any_roughness) {
  for (const float v : in_furnace(metal(0), 1.0, 64).values) ASSERT_NEAR(v, 1.0f, 1e-4);
  for (const float roughness : {0.0f, 0.1f, 0.3f, 0.6f, 1.0f})
    for (const double angle : {0.0, 0.8, 1.3, 1.5})
      EXPECT_NEAR(in_furnace(metal(roughness), angle).mean(), 1, 0.01) << roughness << " " << angle;
}

TEST(Materials, no_material_creates_energy) {
  for (const float roughness : {0.05f, 0.4f, 1.0f})
    for (const float diffuse_roughness : {0.0f, 0.5f, 1.0f})
      for (const double angle : {0.0, 1.2, 1.5}) {
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
  std::vector<kuafu_material_desc> materials{metal(0.4f), metal(0.9f)};
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
  for (const float ior : {1.3f, 2.0f})
    for (const float roughness : {0.0f, 0.5f}) {
      kuafu_material_desc m = lambert(0.7f);
      m.specular = 1, m.ior = ior, m.roughness = roughness;
      materials.push_back(m);
    }
  for (size_t i = 0; i < materials.size(); ++i) {
    const uint32_t tracer = i + 1 == materials.size() ? KUAFU_TRACER_COMPUTE : KUAFU_TRACER_AUTO;
    for (const double angle : {0.9, 1.2}) {
      const double there = brdf(materials[i], 0.2, angle, tracer), back = brdf(materials[i], angle, 0.2, tracer);
      EXPECT_GT(there, 0.01) << i << " " << angle;
      EXPECT_NEAR(there / back, 1, 2e-3) << i << " " << angle;
    }
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
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 4000), 4).mean(), std::pow(0.5, thickness / 0.2), 1e-3);
  }
}

TEST(Materials, a_lamp_behind_absorbing_glass_is_dimmed_the_same) {
  World world;
  kuafu_material_desc m = glass(1.0f);
  m.attenuation_color[0] = 0.5f;
  m.attenuation_distance_m = 0.2f;
  world.add(quad({0, 0, 1}, {-0.1, 0, 0}, {0, 0.1, 0}), lambert(1.0f));
  world.add_point({3, 0, 1 - 3}, 1.0f);
  world.take(1, 0);
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

TEST(Materials, rough_glass_loses_and_creates_nothing) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    World world(tracer);
    world.add(box({1, 1, 0.3}), frosted(0.6f), placed({0, 0, 2}, 0.7));  // paths leave it by all of its faces
    world.set_environment(1.0f);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 16, 16, 48), 256, 100).mean(), 1, 0.01) << tracer;
  }
}

TEST(Materials, nearly_smooth_glass_is_smooth_glass) {
  double means[2];
  for (const bool rough : {false, true}) {
    World world;
    world.add(box({5, 5, 0.01}), rough ? frosted(0.04f) : glass(1.5f), placed({0, 0, 1}, 0.8));
    world.add(quad({0, 0, 20}, {-6, 0, 0}, {0, 6, 0}), emitter(1.0f));
    means[rough] = world.radiance(view_at({0, 0, 0}, 8, 8, 4000), 512, 20).mean();
  }
  EXPECT_NEAR(means[1] / means[0], 1, 0.01);
}

TEST(Materials, light_samples_and_bsdf_samples_agree_through_rough_glass) {
  expect_samplings_agree_through(box({1, 1, 0.05}), frosted(0.5f), 4096, 6);
}

}  // namespace
}  // namespace laws
