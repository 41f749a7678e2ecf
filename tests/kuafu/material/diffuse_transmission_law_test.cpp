// SPDX-License-Identifier: Apache-2.0
// Light that a diffuse base lets through: Lambert's law on the other side, no loss in white sheets, absorption in bodies.
#include "kuafu/material/measured.h"

namespace laws {
namespace {

kuafu_material_desc paper(float albedo, float share, float color) {
  kuafu_material_desc m = lambert(albedo);
  m.thin_walled = 1;
  m.diffuse_transmission = share;
  for (float& c : m.diffuse_transmission_color) c = color;
  return m;
}

const Shape sheet = quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0});

TEST(DiffuseTransmission, of_a_lamp_is_lamberts_on_either_side) {
  for (const double lamp_z : {0.0, 2.0}) {  // before the sheet and behind it, at the camera's distance
    World world;
    kuafu_material_desc material = paper(0.8f, 0.25f, 0.6f);
    world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), material);
    world.add_point({0, 0, lamp_z}, 1);
    world.desc().samples_per_pixel = 4;
    const double albedo = lamp_z == 0 ? 0.75 * 0.8 : 0.25 * 0.6;
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 20000)).mean(), albedo / pi, 1e-4) << lamp_z;
  }
}

TEST(DiffuseTransmission, has_a_colour_of_its_own_in_infrared) {
  World world;
  kuafu_material_desc material = paper(0, 1, 0.5f);
  material.ir_diffuse_transmission_color = 0.9f;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), material);
  kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
  lamp.ir_intensity = 1;
  for (float& i : lamp.intensity) i = 1;
  world.add_light(lamp, placed({0, 0, 2}));
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 20000);
  EXPECT_NEAR(world.radiance(view).mean(), 0.9 / pi, 1e-4);
  view.band = KUAFU_BAND_VISIBLE;
  EXPECT_NEAR(world.radiance(view).mean(), 0.5 / pi, 1e-4);
}

TEST(DiffuseTransmission, of_white_paper_loses_nothing) {
  for (const float specular : {0.0f, 1.0f}) {
    kuafu_material_desc material = paper(1, 0.6f, 1);
    material.specular = specular;
    material.roughness = 0.3f;
    EXPECT_NEAR(in_furnace(material, 0.8).mean(), 1, 0.01) << specular;
  }
}

// Light from one side alone tells whether both parts are sampled as often as their weights say, also where nothing else is there to choose.
TEST(DiffuseTransmission, gives_back_its_part_of_the_light_from_one_side) {
  for (const float subsurface : {0.0f, 1.0f}) {  // of a thing out of sight, with which the host takes path by path
    World world;
    kuafu_material_desc material = paper(0.8f, 0.25f, 1);
    material.specular = 0;
    world.add(sheet, material, placed({0, 0, 1}));
    world.add(sheet, lambert(0), placed({0, 0, 1.01}));
    kuafu_material_desc wax = lambert(0.5f);
    wax.subsurface = subsurface;
    world.add(sheet, wax, placed({0, 0, 2}));
    world.set_environment(1.0f);
    world.desc().samples_per_pixel = 64;
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 2000)).mean(), 0.75 * 0.8, 0.01) << subsurface;
  }
}

// Evenly spread light that crosses a slab has 2 E3(optical thickness) left: 0.4432 of 0.5 (Abramowitz and Stegun, table 5.5).
TEST(DiffuseTransmission, of_a_body_is_absorbed_inside) {
  kuafu_material_desc material = paper(0, 1, 1);
  for (float& c : material.attenuation_color) c = std::exp(-0.5f);
  material.attenuation_distance_m = 0.1;
  const Shape slab = box({50, 50, 0.05});
  EXPECT_NEAR(in_furnace(material, 0.3, 256, KUAFU_TRACER_AUTO, slab).mean(), 1, 0.01) << "a sheet has no inside";
  material.thin_walled = 0;
  EXPECT_NEAR(in_furnace(material, 0.3, 256, KUAFU_TRACER_AUTO, slab).mean(), 0.4432, 0.02);
}

TEST(DiffuseTransmission, of_the_body_around_the_camera_is_absorbed) {
  kuafu_material_desc material = paper(0, 1, 1);
  material.thin_walled = 0;
  for (float& c : material.attenuation_color) c = 0.1f;
  material.attenuation_distance_m = 2;
  World world;
  world.add(box({50, 50, 2}), material, placed({0, 0, 0}));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = 64;
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 2000)).mean(), 0.1, 0.002);
}

}  // namespace
}  // namespace laws
