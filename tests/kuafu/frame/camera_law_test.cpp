// SPDX-License-Identifier: Apache-2.0
// Cameras, AOVs, bands and environments.
#include "kuafu/world.h"

namespace laws {
namespace {

TEST(Camera, depth_is_z_and_ids_are_the_scene_s) {
  World world;
  world.add(quad({0, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  const uint32_t near_id = world.add(quad({0.5, 0, 1}, {-0.5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  const uint32_t removed = world.add(quad({0, 0, 0.5}, {-5, 0, 0}, {0, 5, 0}), lambert(0.5f));
  ok(kuafu_scene_remove_instance(world.scene(), removed));
  const uint32_t late_id = world.add(quad({-0.9, 0, 1.5}, {-0.1, 0, 0}, {0, 5, 0}), lambert(0.5f));
  auto images = world.render({view_at({0, 0, 0}, 65, 33, 30)},
                             {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_NORMAL, KUAFU_OUTPUT_INSTANCE_ID, KUAFU_OUTPUT_MATERIAL_ID});
  for (uint32_t c = 0; c < 65; ++c) {
    const double x = (c - 32.0) / 30;
    if (std::abs(x - 0.0) < 0.02 || std::abs(std::abs(x * 1.5 + 0.9) - 0.1) < 0.02 || std::abs(x - 1) < 0.02) continue;
    const bool near = x > 0 && x<1, late = x * 1.5> - 1 && x * 1.5 < -0.8;
    EXPECT_NEAR(images[KUAFU_OUTPUT_DEPTH].at(0, 5, c), near ? 1.0 : late ? 1.5 : 2.0, 1e-5) << c;
    EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 5, c), near ? near_id - 1 : late ? late_id - 1 : 0u) << c;
    EXPECT_EQ(images[KUAFU_OUTPUT_MATERIAL_ID].id_at(0, 5, c), near ? 1u : late ? 3u : 0u) << c;
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, 5, c, 2), -1.0, 1e-6) << c;
  }
}

TEST(Camera, nothing_hit_is_zero_depth_and_no_id) {
  World world;
  world.add(quad({0, 0, -2}, {1, 0, 0}, {0, 1, 0}), lambert(0.5f));
  auto images = world.render({view_at({0, 0, 0}, 4, 4, 30)}, {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_INSTANCE_ID, KUAFU_OUTPUT_RADIANCE});
  EXPECT_EQ(images[KUAFU_OUTPUT_DEPTH].at(0, 1, 1), 0.0f);
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 1, 1), KUAFU_NOTHING_HIT);
  EXPECT_EQ(images[KUAFU_OUTPUT_RADIANCE].mean(), 0.0);
}

TEST(Camera, near_and_far_cut_by_z) {
  World world;
  for (const double z : {1.0, 2.0, 3.0}) world.add(quad({0, 0, z}, {-9, 0, 0}, {0, 9, 0}), emitter(float(z)));
  kuafu_view_desc view = view_at({0, 0, 0}, 33, 33, 15);
  view.camera.near_m = 1.5;
  auto images = world.render({view}, {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_RADIANCE});
  for (const float z : images[KUAFU_OUTPUT_DEPTH].values) ASSERT_NEAR(z, 2.0f, 1e-5);
  for (const float l : images[KUAFU_OUTPUT_RADIANCE].values) ASSERT_NEAR(l, 2.0f, 1e-5);
  view.camera.near_m = 0;
  view.camera.far_m = 0.9;
  EXPECT_EQ(world.radiance(view).mean(), 0.0);
}

TEST(Camera, normals_are_interpolated_and_survive_scaling) {
  World world;
  auto pose = placed({0, 0, 3});
  pose[0] = 2;  // twice as wide
  world.add(sphere(0.5, 64, true), lambert(0.5f), pose);
  const Pixels normal = world.render({view_at({0, 0, 0}, 65, 65, 120)}, {KUAFU_OUTPUT_NORMAL})[KUAFU_OUTPUT_NORMAL];
  const Pixels depth = world.render({view_at({0, 0, 0}, 65, 65, 120)}, {KUAFU_OUTPUT_DEPTH})[KUAFU_OUTPUT_DEPTH];
  for (uint32_t r = 20; r < 45; r += 6)
    for (uint32_t c = 20; c < 45; c += 6) {
      const double z = depth.at(0, r, c), x = (c - 32.0) / 120 * z, y = (r - 32.0) / 120 * z;
      const Vec3 n{x / 4, y, z - 3};  // gradient of (x/2)^2 + y^2 + (z-3)^2
      const double length = std::hypot(n[0], n[1], n[2]);
      for (uint32_t i = 0; i < 3; ++i) EXPECT_NEAR(normal.at(0, r, c, i), n[i] / length, 0.01);
    }
}

TEST(Bands, infrared_takes_its_own_albedo_and_lights) {
  World world;
  kuafu_material_desc m = lambert(0.0f);
  m.base_color[0] = 0.8f;
  m.base_color[1] = 0.4f;
  m.base_color[2] = 0.2f;
  m.ir_albedo = 0.3f;
  world.add(quad({0, 0, 1}, {-9, 0, 0}, {0, 9, 0}), m);
  kuafu_environment_desc e = kuafu_environment_desc_init();
  for (float& r : e.radiance) r = 2.0f;
  ok(kuafu_scene_set_environment(world.scene(), &e));
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 100);
  world.desc().ir_ambient_scale = 0.05f;
  world.desc().ir_ambient_radiance = 0.01f;
  EXPECT_NEAR(world.radiance(view).mean(), 0.3 * (2.0 * 0.05 + 0.01), 1e-5);
  world.desc().ir_ambient_scale = 0.5f;
  EXPECT_NEAR(world.radiance(view).mean(), 0.3 * (2.0 * 0.5 + 0.01), 1e-4);
  view.band = KUAFU_BAND_VISIBLE;
  const Pixels visible = world.radiance(view);
  EXPECT_NEAR(visible.at(0, 1, 1, 0), 1.6, 1e-4);
  EXPECT_NEAR(visible.at(0, 1, 1, 1), 0.8, 1e-4);
  EXPECT_NEAR(visible.at(0, 1, 1, 2), 0.4, 1e-4);
}

TEST(Bands, missing_infrared_albedo_is_red) {
  World world;
  kuafu_material_desc m = lambert(0.0f);
  m.base_color[0] = 0.8f;
  world.add(quad({0, 0, 1}, {-9, 0, 0}, {0, 9, 0}), m);
  world.set_environment(1.0f);
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 100)).mean(), 0.8, 1e-4);
}

TEST(Environments, each_view_sees_its_own) {
  World world;
  world.add(quad({0, 0, 2}, {-9, 0, 0}, {0, 9, 0}), lambert(0.5f));
  const uint32_t mine = world.add(quad({0, 0, 1}, {-0.3, 0, 0}, {0, 0.3, 0}), lambert(0.5f), placed({0, 0, 0}), 1);
  world.add_point({0, 0, 0}, 1.0f, 0);
  world.add_point({0, 0, 0}, 3.0f, 2);
  world.desc().max_bounces = 0;
  std::vector<kuafu_view_desc> views(3, view_at({0, 0, 0}, 5, 5, 100));
  for (uint32_t i = 0; i < 3; ++i) views[i].environment = i;
  auto images = world.render(views, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_INSTANCE_ID});
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(0, 2, 2), 0u);
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(1, 2, 2), mine - 1);
  EXPECT_EQ(images[KUAFU_OUTPUT_INSTANCE_ID].id_at(2, 2, 2), 0u);
  EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].at(0, 2, 2), 0.5 / pi / 4, 1e-4);
  EXPECT_EQ(images[KUAFU_OUTPUT_RADIANCE].at(1, 2, 2), 0.0f);
  EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].at(2, 2, 2), 3 * 0.5 / pi / 4, 3e-4);
}

}  // namespace
}  // namespace laws
