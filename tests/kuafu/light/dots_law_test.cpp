// SPDX-License-Identifier: Apache-2.0
// A projector's dots and its pattern's scale: where they land, what power they have; and textures that change between frames.
#include "kuafu/light/spot.h"

namespace laws {
namespace {

constexpr uint32_t side = 32;
constexpr double focal_px = 40, half = (side - 1) / 2.0;

kuafu_light_desc dot_projector(const std::vector<float>& dots, float sigma_px) {
  kuafu_light_desc light = light_of(KUAFU_LIGHT_PROJECTOR, 1);
  const double k[9] = {focal_px, 0, half, 0, focal_px, half, 0, 0, 1};
  std::memcpy(light.k, k, sizeof k);
  light.dots = dots.data();
  light.dot_count = uint32_t(dots.size() / 3);
  light.pattern_width = light.pattern_height = side;
  light.dot_sigma_px = sigma_px;
  return light;
}

/// On a wall at 1 m; its centre in pixels of the pattern.
Spot spot_on_wall(World& world) {
  Spot spot = spot_on_wall(world, 1, side, focal_px);
  spot.x = spot.x * focal_px + half;
  spot.y = spot.y * focal_px + half;
  return spot;
}

TEST(Dots, stand_on_a_background_that_is_everywhere) {
  World world;
  const std::vector<float> dot{16.0f, 16.0f, 2.5f};
  kuafu_light_desc light = dot_projector(dot, 1.2f);
  light.dot_background = 0.25;
  world.add_light(light, placed({0, 0, 0}));
  // Over the last half pixel the image fades: an eighth of a pixel is lost along each border.
  EXPECT_NEAR(spot_on_wall(world).power, 2.5 + 0.25 * (side * side - 4 * side / 8.0), 0.3);
}

TEST(Dots, keep_their_power_and_place_between_pixels) {
  for (const float sigma : {0.3f, 1.2f})
    for (const float u : {11.0f, 11.3f, 11.5f}) {
      World world;
      const std::vector<float> dot{u, 17.8f, 2.5f};
      world.add_light(dot_projector(dot, sigma), placed({0, 0, 0}));
      const Spot spot = spot_on_wall(world);
      EXPECT_NEAR(spot.power, 2.5, 0.02) << sigma << " " << u;
      const double tolerance = sigma < 1 ? 0.06 : 0.02;  // a dot smaller than a pixel is known by the pixels alone
      EXPECT_NEAR(spot.x, u, tolerance) << sigma;
      EXPECT_NEAR(spot.y, 17.8, tolerance) << sigma;
    }
}

TEST(Dots, pattern_scale_moves_them_away_from_the_principal_point) {
  World world;
  const std::vector<float> dot{20.0f, 10.0f, 1.0f};
  kuafu_light_desc light = dot_projector(dot, 1.2f);
  light.pattern_scale = 1.2;
  world.add_light(light, placed({0, 0, 0}));
  const Spot spot = spot_on_wall(world);
  EXPECT_NEAR(spot.x, half + 1.2 * (20 - half), 0.02);
  EXPECT_NEAR(spot.y, half + 1.2 * (10 - half), 0.02);
  EXPECT_NEAR(spot.power, 1.44, 0.02) << "intensity stays, the solid angle grows";
}

TEST(Dots, can_be_read_back_and_set_again) {
  World world;
  const std::vector<float> dots{12, 13, 1, 20, 9, 0.5f};
  const uint32_t id = world.add_light(dot_projector(dots, 1.0f), placed({0, 0, 0}));
  EXPECT_NEAR(spot_on_wall(world).power, 1.5, 0.02);
  kuafu_light_desc light = kuafu_light_desc_init(0);
  ok(kuafu_scene_get_light(world.scene(), id, &light));
  ASSERT_EQ(light.dot_count, 2u);
  EXPECT_TRUE(std::equal(dots.begin(), dots.end(), light.dots));
  light.dot_count = 1;  // its own memory may be handed back
  ok(kuafu_scene_set_light(world.scene(), id, &light));
  const Spot spot = spot_on_wall(world);
  EXPECT_NEAR(spot.power, 1, 0.02);
  EXPECT_NEAR(spot.x, 12, 0.02);
}

TEST(Dots, bad_ones_are_refused_with_the_numbers) {
  World world;
  const auto refused = [&](kuafu_light_desc light, const std::string& text) {
    uint32_t id = 0;
    expect_refused(kuafu_scene_add_light(world.scene(), &light, &id), text);
  };
  const std::vector<float> one{1, 2, 1}, negative{1, 2, -1};
  refused(dot_projector(one, 0.0f), "dot_sigma_px is 0");
  kuafu_light_desc dark = dot_projector(one, 1.0f);
  dark.dot_background = -1;
  refused(dark, "dot_background");
  refused(dot_projector(negative, 1.0f), "dots[0]");
  kuafu_light_desc light = dot_projector(one, 1.0f);
  light.pattern_width = 0;
  refused(light, "pattern_width and pattern_height are 0 and 32");
  light = dot_projector(one, 1.0f);
  light.pattern_scale = 0;
  refused(light, "pattern_scale is 0");
  light = dot_projector(one, 1.0f);
  light.kind = KUAFU_LIGHT_POINT;
  refused(light, "only a projector takes dots");
  const std::vector<float> many(3 * 4096, 1.0f);
  light = dot_projector(many, 1e4f);
  light.pattern_width = light.pattern_height = 32768;
  refused(light, "give it as a texture");
}

void set_texture(World& world, uint32_t id, uint32_t width, uint32_t height, float value) {
  const std::vector<float> texels(size_t(width) * height, value);
  const kuafu_texture_desc texture = texture_of(texels, width);
  ok(kuafu_scene_set_texture(world.scene(), id, &texture));
}

TEST(SetTexture, a_projector_shows_the_new_pattern_whatever_its_size) {
  World world;
  world.add_projector(std::vector<float>(9 * 9, 1.0f), 9, 9, 4, 1.0f);
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), lambert(1.0f));
  world.take(16, 0);
  const kuafu_view_desc view = view_at({0, 0, 0}, 1, 1, 1000);
  const float full = world.radiance(view).at(0, 0, 0);
  set_texture(world, 1, 9, 9, 0.5f);
  EXPECT_NEAR(world.radiance(view).at(0, 0, 0), full / 2, 1e-3f * full);
  set_texture(world, 1, 13, 11, 0.25f);
  EXPECT_NEAR(world.radiance(view).at(0, 0, 0), full / 4, 1e-3f * full);
  EXPECT_EQ(kuafu_scene_set_texture(world.scene(), 5, nullptr), KS_ERROR_INVALID_ARGUMENT);
}

TEST(SetTexture, materials_and_the_environment_show_the_new_one) {
  World world;
  const uint32_t texture = world.add_texture(texture_of(std::vector<float>(4, 1.0f), 2));
  kuafu_environment_desc environment = kuafu_environment_desc_init();
  environment.ir_radiance = 1;
  environment.texture = texture;
  ok(kuafu_scene_set_environment(world.scene(), &environment));
  kuafu_material_desc material = lambert(1.0f);
  material.base_color_texture = texture;
  world.add(quad({0, 0, 1}, {-0.05, 0, 0}, {0, 0.05, 0}), material);
  const kuafu_view_desc view = view_at({0, 0, 0}, 9, 9, 30);
  const Pixels first = world.radiance(view);
  set_texture(world, texture, 3, 4, 0.5f);
  const Pixels second = world.radiance(view);
  EXPECT_NEAR(second.at(0, 0, 0), first.at(0, 0, 0) / 2, 1e-5f) << "sky";
  EXPECT_NEAR(second.at(0, 4, 4), first.at(0, 4, 4) / 4, 0.01f) << "plane under the sky";
}

}  // namespace
}  // namespace laws
