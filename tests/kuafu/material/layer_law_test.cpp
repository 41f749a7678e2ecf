// SPDX-License-Identifier: Apache-2.0
// What lies over or lets through a base: the reflecting layer, a clear coat, paper.
#include "kuafu/material/measured.h"

namespace laws {
namespace {

kuafu_material_desc dielectric(float ior, float roughness, float base = 1) {
  kuafu_material_desc m = lambert(base);
  m.specular = 1;
  m.ior = ior;
  m.roughness = roughness;
  return m;
}

TEST(Layer, reflects_what_fresnel_says) {
  for (const float ior : {1.2f, 1.5f, 2.4f})
    for (const double angle : {0.0, 0.6, 1.1, 1.4}) {
      kuafu_material_desc m = dielectric(ior, 0, 0);
      EXPECT_NEAR(in_furnace(m, angle, 16).mean(), reflectance(angle, ior), 2e-3) << ior << " " << angle;
      m.specular = 0.5f;
      EXPECT_NEAR(in_furnace(m, angle, 16).mean(), reflectance(angle, ior) / 2, 1e-3) << ior << " " << angle;
    }
}

TEST(Layer, over_a_white_base_loses_nothing) {
  for (const float ior : {1.2f, 1.5f, 1.8f})
    for (const float roughness : {0.0f, 0.25f, 0.6f, 1.0f})
      for (const double angle : {0.0, 0.8, 1.3})
        EXPECT_NEAR(in_furnace(dielectric(ior, roughness), angle, 128).mean(), 1, 0.01) << ior << " " << roughness << " " << angle;
  EXPECT_NEAR(in_furnace(dielectric(1.5f, 0.3f), 0.8, 128, KUAFU_TRACER_COMPUTE).mean(), 1, 0.01);
}

TEST(Layer, of_index_one_or_specular_zero_is_not_there) {
  for (const double angle : {0.0, 1.2}) {
    EXPECT_NEAR(in_furnace(dielectric(1, 0.4f, 0.3f), angle, 4).mean(), 0.3, 1e-5);
    kuafu_material_desc m = dielectric(1.5f, 0.4f, 0.3f);
    m.specular = 0;
    EXPECT_NEAR(in_furnace(m, angle, 4).mean(), 0.3, 1e-5);
  }
}

/// Mean of a plane in even light, seen at 1 from its normal. texture: the material's, of 0.4 all over.
double seen(kuafu_material_desc m, uint32_t band, uint32_t kuafu_material_desc::*texture = nullptr) {
  World world;
  if (texture != nullptr) m.*texture = world.add_texture(texture_of(std::vector<uint8_t>(4, 102), 2));
  world.add(quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0}), m, placed({0, 0, 1}, 1.0));
  world.set_environment(1.0f);
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 2000);
  view.band = band;
  return world.radiance(view, 64).mean();
}

TEST(Layer, the_infrared_has_its_own_roughness_index_and_transmission) {
  kuafu_material_desc m = dielectric(1.5f, 0, 0);
  m.ir_ior = 1.2f;
  EXPECT_NEAR(seen(m, KUAFU_BAND_VISIBLE), reflectance(1.0, 1.5), 2e-3);
  EXPECT_NEAR(seen(m, KUAFU_BAND_INFRARED), reflectance(1.0, 1.2), 2e-3);
  kuafu_material_desc film = lambert(0.2f);  // dark paint that lets the infrared through
  film.ior = 1;
  film.ir_albedo = 1;
  film.ir_transmission = 1;
  film.ir_transmission_roughness = 0;
  EXPECT_NEAR(seen(film, KUAFU_BAND_VISIBLE), 0.2, 1e-3);
  EXPECT_NEAR(seen(film, KUAFU_BAND_INFRARED), 1, 1e-3);
  kuafu_material_desc matt = dielectric(1.5f, 0, 0);
  matt.ir_roughness = 1;
  EXPECT_NEAR(seen(matt, KUAFU_BAND_VISIBLE), reflectance(1.0, 1.5), 2e-3);
  EXPECT_LT(seen(matt, KUAFU_BAND_INFRARED), 0.9 * reflectance(1.0, 1.5)) << "facets of all tilts";
}

TEST(Layer, textures_scale_the_index_and_the_infrared_albedo) {
  constexpr auto ior = &kuafu_material_desc::ior_texture, albedo = &kuafu_material_desc::ir_albedo_texture;
  EXPECT_NEAR(seen(dielectric(1.5f, 0, 0), KUAFU_BAND_INFRARED, ior), reflectance(1.0, 1.2), 2e-3);
  kuafu_material_desc m = lambert(0.9f);
  EXPECT_NEAR(seen(m, KUAFU_BAND_INFRARED, albedo), 0.4, 1e-3) << "not the red of the base colour";
  EXPECT_NEAR(seen(m, KUAFU_BAND_VISIBLE, albedo), 0.9, 1e-3);
  m.ir_albedo = 0.5f;
  EXPECT_NEAR(seen(m, KUAFU_BAND_INFRARED, albedo), 0.2, 1e-3);
}

kuafu_material_desc coated(kuafu_material_desc m, float weight, float roughness) {
  m.clearcoat = weight;
  m.clearcoat_roughness = roughness;
  return m;
}

TEST(Clearcoat, over_black_reflects_what_fresnel_says) {
  for (const float weight : {1.0f, 0.4f})
    for (const double angle : {0.0, 0.8, 1.3})
      EXPECT_NEAR(in_furnace(coated(lambert(0), weight, 0), angle, 128).mean(), weight * reflectance(angle, 1.5), 2e-3)
          << weight << " " << angle;
  EXPECT_LT(in_furnace(coated(lambert(0), 1, 1), 1.3, 128).mean(), 0.7 * reflectance(1.3, 1.5)) << "facets of all tilts";
}

TEST(Clearcoat, over_glass_is_not_there) {
  const auto seen = [](float weight) {
    World world;
    world.add(box({5, 5, 0.1}), coated(glass(1.5f), weight, 0), placed({0, 0, 1}, 0.5));
    world.add(quad({0, 0, 3}, {-4, 0, 0}, {0, 4, 0}), emitter(1.0f));
    return world.radiance(view_at({0, 0, 0}, 8, 8, 4000), 64).mean();
  };
  EXPECT_DOUBLE_EQ(seen(1), seen(0));
}

TEST(Clearcoat, that_is_rough_is_lit_by_a_lamp) {
  World world;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), coated(lambert(0), 1, 0.5f));
  world.add_point({0, 0, 0}, 1);
  const double half = 0.0625;  // alpha squared: at the mirrored direction the distribution is 1 / (pi alpha^2), and nothing is masked
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 20000), 4).mean(), 0.04 / (4 * pi * half), 2e-3);
}

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
    const double albedo = lamp_z == 0 ? 0.75 * 0.8 : 0.25 * 0.6;
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 20000), 4).mean(), albedo / pi, 1e-4) << lamp_z;
  }
}

TEST(DiffuseTransmission, has_a_colour_of_its_own_in_infrared) {
  World world;
  kuafu_material_desc material = paper(0, 1, 0.5f);
  material.ir_diffuse_transmission_color = 0.9f;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), material);
  kuafu_light_desc lamp = light_of(KUAFU_LIGHT_POINT, 1);
  for (float& i : lamp.intensity) i = 1;
  world.add_light(lamp, placed({0, 0, 2}));
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 20000);
  EXPECT_NEAR(world.radiance(view).mean(), 0.9 / pi, 1e-4);
  view.band = KUAFU_BAND_VISIBLE;
  EXPECT_NEAR(world.radiance(view).mean(), 0.5 / pi, 1e-4);
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
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 2000), 64).mean(), 0.75 * 0.8, 0.01) << subsurface;
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
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 2000), 64).mean(), 0.1, 0.002);
}

}  // namespace
}  // namespace laws
