// SPDX-License-Identifier: Apache-2.0
// Light groups: each holds the light of its own sources, whatever way it took, and together they are the image.
#include "kuafu/world.h"

namespace {

using namespace laws;

constexpr uint32_t group_0 = KUAFU_OUTPUT_LIGHT_GROUP_0;
const std::vector<uint32_t> everything = {KUAFU_OUTPUT_RADIANCE,
                                          KUAFU_OUTPUT_PROJECTOR_DIRECT,
                                          KUAFU_OUTPUT_PROJECTOR_INDIRECT,
                                          KUAFU_OUTPUT_AMBIENT,
                                          group_0,
                                          group_0 + 1,
                                          group_0 + 2,
                                          group_0 + 3};

/// A room corner with a light of every kind: a lamp, an emissive panel, a rectangle, an environment, a projector. `on` switches one group
/// on alone.
struct Room {
  explicit Room(uint32_t tracer = KUAFU_TRACER_AUTO, int on = -1) : world(tracer) {
    world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f));
    world.add(quad({-1, 0, 1}, {0, 0, 1}, {0, 1, 0}), lambert(0.8f));
    const auto lit = [&](int group, float value) { return on < 0 || on == group ? value : 0.0f; };
    kuafu_material_desc panel = emitter(lit(1, 3.0f));
    panel.light_group = 1;
    world.add(quad({0.8, 0.5, 1.2}, {0.2, 0, 0}, {0, 0.2, 0}), panel);
    kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
    lamp.ir_intensity = lit(3, 0.7f);
    lamp.light_group = 3;
    world.add_light(lamp, placed({0.3, -0.4, 1}));
    kuafu_light_desc rectangle = kuafu_light_desc_init(KUAFU_LIGHT_RECTANGLE);
    rectangle.ir_intensity = lit(1, 5.0f);
    rectangle.size_m[0] = rectangle.size_m[1] = 0.3;
    rectangle.light_group = 1;
    world.add_light(rectangle, placed({0.5, -0.5, 0.5}, -0.4));
    world.set_environment(lit(2, 0.2f), 2);
    if (on < 0 || on == 4) world.add_projector({0, 1, 1, 0}, 2, 2, 2, 1.0f);
    world.desc().samples_per_pixel = 64;
    world.desc().max_bounces = 3;
  }
  auto images() { return world.render({view_at({0, 0, 0}, 12, 9, 10)}, everything); }
  World world;
};

TEST(LightGroups, sum_to_the_full_image) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    auto images = Room(tracer).images();
    for (size_t i = 0; i < images[KUAFU_OUTPUT_RADIANCE].values.size(); ++i) {
      const auto value = [&](uint32_t output) { return double(images[output].values[i]); };
      const double ambient = value(group_0) + value(group_0 + 1) + value(group_0 + 2) + value(group_0 + 3);
      const double all = value(KUAFU_OUTPUT_PROJECTOR_DIRECT) + value(KUAFU_OUTPUT_PROJECTOR_INDIRECT) + value(KUAFU_OUTPUT_AMBIENT);
      EXPECT_NEAR(ambient, value(KUAFU_OUTPUT_AMBIENT), 1e-6 * ambient);
      EXPECT_NEAR(all, value(KUAFU_OUTPUT_RADIANCE), 1e-6 * all);
    }
    EXPECT_EQ(images[group_0].mean(), 0.0);  // no light says 0
  }
}

TEST(LightGroups, hold_what_their_lights_give_alone) {
  auto all = Room().images();
  for (const uint32_t group : {1u, 2u, 3u}) {
    auto alone = Room(KUAFU_TRACER_AUTO, int(group)).images();
    EXPECT_GT(alone[KUAFU_OUTPUT_RADIANCE].mean(), 0.02);
    EXPECT_NEAR(all[group_0 + group].mean(), alone[KUAFU_OUTPUT_RADIANCE].mean(), 0.02 * alone[KUAFU_OUTPUT_RADIANCE].mean()) << group;
    for (const uint32_t other : {1u, 2u, 3u}) {
      if (other == group) continue;
      EXPECT_EQ(alone[group_0 + other].mean(), 0.0) << group << other;
    }
  }
}

TEST(LightGroups, asked_for_or_not_the_image_is_the_same) {
  Room room;
  const kuafu_view_desc view = view_at({0, 0, 0}, 12, 9, 10);
  auto with = room.images();
  auto without = room.world.render({view}, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_AMBIENT});
  for (size_t i = 0; i < with[KUAFU_OUTPUT_RADIANCE].values.size(); ++i) {
    const double expected = without[KUAFU_OUTPUT_RADIANCE].values[i];
    EXPECT_NEAR(with[KUAFU_OUTPUT_RADIANCE].values[i], expected, 1e-5 * expected);
  }
}

TEST(LightGroups, beyond_the_last_are_refused) {
  World world;
  kuafu_light_desc light = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  light.light_group = 4;
  uint32_t id = 0;
  EXPECT_EQ(kuafu_scene_add_light(world.scene(), &light, &id), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_NE(std::string(kuafu_last_error()).find("light_group is 4"), std::string::npos) << kuafu_last_error();
}

}  // namespace
