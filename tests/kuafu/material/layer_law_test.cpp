// SPDX-License-Identifier: Apache-2.0
// The dielectric's layer: Fresnel's exact reflectance, no loss for a white base, reciprocity for any index; textures and infrared values of
// it.
#include "kuafu/material/fresnel.h"
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

TEST(Layer, is_reciprocal) {
  for (const float ior : {1.3f, 2.0f})
    for (const float roughness : {0.0f, 0.5f}) {
      const uint32_t tracer = ior == 2.0f && roughness == 0.5f ? KUAFU_TRACER_COMPUTE : KUAFU_TRACER_AUTO;
      const kuafu_material_desc m = dielectric(ior, roughness, 0.7f);
      const double there = brdf(m, 0.2, 1.2, tracer), back = brdf(m, 1.2, 0.2, tracer);
      EXPECT_GT(there, 0.05) << ior << " " << roughness;
      EXPECT_NEAR(there / back, 1, 2e-3) << ior << " " << roughness;
    }
}

TEST(Layer, the_infrared_has_its_own_roughness_index_and_transmission) {
  const auto seen = [](const kuafu_material_desc& m, uint32_t band) {
    World world;
    world.add(quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0}), m, placed({0, 0, 1}, 1.0));
    world.set_environment(1.0f);
    world.desc().samples_per_pixel = 64;
    kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 2000);
    view.band = band;
    return world.radiance(view).mean();
  };
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

uint32_t grey_texture(World& world, uint8_t value) { return world.add_texture(texture_of(std::vector<uint8_t>(4, value), 2)); }

TEST(Layer, textures_scale_the_index_and_the_infrared_albedo) {
  const auto seen = [](kuafu_material_desc m, bool index, uint32_t band) {
    World world;
    (index ? m.ior_texture : m.ir_albedo_texture) = grey_texture(world, 102);  // 0.4
    world.add(quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0}), m, placed({0, 0, 1}, 1.0));
    world.set_environment(1.0f);
    world.desc().samples_per_pixel = 16;
    kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 2000);
    view.band = band;
    return world.radiance(view).mean();
  };
  EXPECT_NEAR(seen(dielectric(1.5f, 0, 0), true, KUAFU_BAND_INFRARED), reflectance(1.0, 1.2), 2e-3);
  kuafu_material_desc m = lambert(0.9f);
  EXPECT_NEAR(seen(m, false, KUAFU_BAND_INFRARED), 0.4, 1e-3) << "not the red of the base colour";
  EXPECT_NEAR(seen(m, false, KUAFU_BAND_VISIBLE), 0.9, 1e-3);
  m.ir_albedo = 0.5f;
  EXPECT_NEAR(seen(m, false, KUAFU_BAND_INFRARED), 0.2, 1e-3);
}

}  // namespace
}  // namespace laws
