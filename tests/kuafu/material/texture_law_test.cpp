// SPDX-License-Identifier: Apache-2.0
// Material textures: where a texel lies, how it is decoded, and that each map multiplies its factor.
#include "kuafu/world.h"

namespace laws {
namespace {

// A wall at z = 1 whose uv (0, 0) is at the upper left of the image and (repeats, repeats) at the lower right, in an environment of
// radiance 1.
Shape wall(float repeats = 1) {
  Shape shape;
  shape.positions = {-1, -1, 1, 1, -1, 1, 1, 1, 1, -1, 1, 1};
  shape.uvs = {0, 0, repeats, 0, repeats, repeats, 0, repeats};
  shape.indices = {0, 2, 1, 0, 3, 2};
  return shape;
}

uint32_t add_texture(World& world, const std::vector<uint8_t>& texels, uint32_t width, uint32_t channels, bool srgb) {
  kuafu_texture_desc t = texture_of(texels, width, channels);
  t.srgb = srgb;
  return world.add_texture(t);
}

kuafu_view_desc visible_view(uint32_t size) {
  kuafu_view_desc view = view_at({0, 0, 0}, size, size, size / 2.0);  // the wall fills the image
  view.band = KUAFU_BAND_VISIBLE;
  return view;
}

TEST(Textures, row_zero_is_at_the_top_and_colours_are_decoded) {
  World world;
  world.set_environment(1.0f);
  kuafu_material_desc m = lambert(1.0f);
  m.base_color[1] = 0.5f;
  // Red, green / blue, grey; each covers 64 x 64 pixels and is read at its centre.
  m.base_color_texture = add_texture(world, {255, 0, 0, 0, 255, 0, 0, 0, 255, 128, 128, 128}, 2, 3, true);
  world.add(wall(), m);
  const Pixels image = world.radiance(visible_view(128));
  const double grey = 0.21586;  // of 128 / 255, IEC 61966-2-1
  const double expected[4][3] = {{1, 0, 0}, {0, 0.5, 0}, {0, 0, 1}, {grey, grey / 2, grey}};
  for (int i = 0; i < 4; ++i)  // texel centres lie on the corner between four pixels
    for (uint32_t c = 0; c < 3; ++c) {
      double mean = 0;
      for (const uint32_t row : {31u, 32u})
        for (const uint32_t column : {31u, 32u}) mean += image.at(0, row + (i / 2) * 64, column + (i % 2) * 64, c) / 4;
      EXPECT_NEAR(mean, expected[i][c], 0.04) << "texel " << i << " channel " << c;
    }
}

TEST(Textures, interpolation_keeps_the_mean_and_repeats) {
  World world;
  world.set_environment(1.0f);
  kuafu_material_desc m = lambert(1.0f);
  m.base_color_texture = add_texture(world, {0, 255, 102, 51}, 2, 1, false);
  world.add(wall(3), m);
  world.desc().samples_per_pixel = 256;
  EXPECT_NEAR(world.radiance(visible_view(24)).mean(), 0.4, 0.004);
}

TEST(Textures, infrared_takes_red_unless_it_has_its_own_albedo) {
  for (const bool own : {false, true}) {
    World world;
    world.set_environment(1.0f);
    kuafu_material_desc m = lambert(1.0f);
    m.base_color_texture = add_texture(world, {102, 255, 255}, 1, 3, false);
    if (own) m.ir_albedo = 0.7f;
    world.add(wall(), m);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 100)).mean(), own ? 0.7 : 0.4, 1e-3);
  }
}

TEST(Textures, a_flat_normal_map_changes_nothing_and_a_tilted_one_turns_the_surface) {
  // Sun-like light far along the axis: a normal turned by 30 degrees receives cos 30 of it.
  for (const bool tilted : {false, true}) {
    World world;
    kuafu_material_desc m = lambert(1.0f);
    m.normal_texture = tilted ? add_texture(world, {191, 128, 238}, 1, 3, false) : add_texture(world, {128, 128, 255}, 1, 3, false);
    world.add(wall(), m);
    world.add_point({0, 0, -999}, 1e6f * float(pi));
    world.desc().max_bounces = 0;
    auto images = world.render({view_at({0, 0, 0}, 8, 8, 100)}, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_NORMAL});
    EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].mean(), tilted ? std::cos(pi / 6) : 1.0, 0.01);
    // Tangent x is along growing u, which is the world's +x here; the wall faces -z.
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, 4, 4, 0), tilted ? 0.5 : 0.0, 0.01);
    EXPECT_NEAR(images[KUAFU_OUTPUT_NORMAL].at(0, 4, 4, 2), tilted ? -std::cos(pi / 6) : -1.0, 0.01);
  }
}

TEST(Textures, green_of_a_normal_map_points_against_v) {
  World world;
  kuafu_material_desc m = lambert(1.0f);
  m.normal_texture = add_texture(world, {128, 191, 238}, 1, 3, false);
  world.add(wall(), m);
  const Pixels normal = world.render({view_at({0, 0, 0}, 8, 8, 100)}, {KUAFU_OUTPUT_NORMAL})[KUAFU_OUTPUT_NORMAL];
  EXPECT_NEAR(normal.at(0, 4, 4, 1), -0.5, 0.01);  // v grows along +y
}

TEST(Textures, transmission_and_specular_maps_multiply_their_factors) {
  // Fully transmitting glass of index 1, switched off by its map, is the base alone; a specular map of 0 leaves Lambert.
  World world;
  world.set_environment(1.0f);
  kuafu_material_desc m = kuafu_material_desc_init();
  for (int i = 0; i < 3; ++i) m.base_color[i] = 0.5f;
  m.transmission = 1;
  m.transmission_texture = add_texture(world, {0}, 1, 1, false);
  m.specular_texture = add_texture(world, {255, 255, 255, 0}, 1, 4, false);
  world.add(wall(), m);
  for (const float v : world.radiance(view_at({0, 0, 0}, 8, 8, 100)).values) ASSERT_NEAR(v, 0.5f, 1e-3);
}

}  // namespace
}  // namespace laws
