// SPDX-License-Identifier: Apache-2.0
// White furnaces and closed forms of interreflection: no energy is created, and where the answer is known it comes out.
#include "kuafu/material/measured.h"

namespace laws {
namespace {

kuafu_material_desc reflector(float metallic, float roughness, float specular) {
  kuafu_material_desc m = kuafu_material_desc_init();
  m.metallic = metallic;
  m.roughness = roughness;
  m.specular = specular;
  return m;
}

TEST(Furnace, a_lambertian_plane_shows_albedo_times_environment) {
  for (const float albedo : {0.0f, 0.18f, 1.0f})
    for (const float v : in_furnace(lambert(albedo), 0.7, 64).values) ASSERT_NEAR(v, albedo, 1e-4);
}

TEST(Furnace, a_white_lambertian_ball_vanishes) {
  World world;
  world.add(sphere(0.5, 24, false), lambert(1.0f), placed({0, 0, 2}));
  world.set_environment(1.0f);
  for (const float v : world.radiance(view_at({0, 0, 0}, 32, 32, 60)).values) ASSERT_NEAR(v, 1.0f, 1e-3);
}

TEST(Furnace, metal_and_coated_base_create_no_energy) {
  for (const float metallic : {0.0f, 1.0f})
    for (const float roughness : {0.0f, 0.1f, 0.4f, 1.0f})
      for (const double angle : {0.0, 1.0, 1.5}) {
        const double mean = in_furnace(reflector(metallic, roughness, 1.0f), angle, 64).mean();
        EXPECT_LT(mean, 1.01) << "metallic " << metallic << " roughness " << roughness << " angle " << angle;
        EXPECT_GT(mean, roughness == 1.0f ? 0.3 : 0.7) << "metallic " << metallic << " roughness " << roughness << " angle " << angle;
      }
}

TEST(Furnace, a_white_mirror_loses_nothing) {
  for (const float v : in_furnace(reflector(1.0f, 0.0f, 1.0f), 1.0, 64).values) ASSERT_NEAR(v, 1.0f, 1e-4);
}

TEST(Furnace, clear_glass_vanishes) {
  World world;
  world.add(sphere(0.5, 16, false), glass(1.5f), placed({0, 0, 2}));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = 64;
  world.desc().max_bounces = 64;
  const Pixels image = world.radiance(view_at({0, 0, 0}, 32, 32, 60));
  EXPECT_NEAR(image.mean(), 1.0, 0.01);
  for (const float v : image.values) ASSERT_LT(v, 2.3f);  // n^2 at most: a path that ends inside
}

TEST(Furnace, glass_with_interpolated_normals_keeps_its_energy) {
  World world;
  world.add(sphere(0.5, 48, true), glass(1.5f), placed({0, 0, 2}));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = 16;
  world.desc().max_bounces = 32;
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 48, 48, 90)).mean(), 1.0, 0.01);
}

// Closed room of albedo rho whose walls shine with E: L = E + rho L. The bright environment outside must not leak in.
TEST(Furnace, a_shining_room_is_the_geometric_series) {
  for (const float rho : {0.3f, 0.7f}) {
    World world;
    kuafu_material_desc wall = emitter(1.0f);
    for (int i = 0; i < 3; ++i) wall.base_color[i] = rho;
    world.add(box({1, 1, 1}), wall);
    world.set_environment(1e4f);
    world.desc().samples_per_pixel = 64;
    world.desc().max_bounces = 100;
    const double expected = 1 / (1 - rho);
    EXPECT_NEAR(world.radiance(view_at({0.2, 0.1, -0.3}, 32, 32, 20)).mean(), expected, 0.005 * expected);
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

}  // namespace
}  // namespace laws
