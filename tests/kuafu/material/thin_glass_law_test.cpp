// SPDX-License-Identifier: Apache-2.0
// Sheets of glass (thin_walled) against the closed forms of a plate: what they reflect, let through and leave alone.
#include "kuafu/light_sampling.h"
#include "kuafu/material/fresnel.h"
#include "kuafu/world.h"

namespace laws {
namespace {

// Airy's sums without interference: all reflections between both faces, each way across leaving `tint`.
double plate_transmittance(double r, double tint) { return (1 - r) * (1 - r) * tint / (1 - r * r * tint * tint); }
double plate_reflectance(double r, double tint) { return r + plate_transmittance(r, tint) * tint * r; }

kuafu_material_desc sheet(float ior, float tint = 1, float roughness = 0) {
  kuafu_material_desc m = glass(ior);
  m.thin_walled = 1;
  m.ir_albedo = tint;
  m.transmission_roughness = roughness;
  return m;
}

Shape pane(double half = 5) { return quad({0, 0, 0}, {-half, 0, 0}, {0, half, 0}); }

TEST(ThinGlass, lets_through_and_reflects_as_a_plate_does) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE})
    for (const float tint : {1.0f, 0.6f})
      for (const double angle : {0.4, 1.3, 0.4 + pi}) {  // the last from behind
        if (tracer == KUAFU_TRACER_COMPUTE && angle != 1.3) continue;
        World world(tracer);
        world.add(pane(), sheet(1.5f, tint), placed({0, 0, 1}, angle));
        world.add(quad({0, 0, 20}, {-3, 0, 0}, {0, 3, 0}), emitter(1.0f));  // too small for what is reflected
        world.desc().samples_per_pixel = 256;
        world.desc().max_bounces = 1;
        const double r = reflectance(std::fmod(angle, pi), 1.5), through = plate_transmittance(r, tint);
        const kuafu_view_desc view = view_at({0, 0, 0}, 16, 16, 4000);
        EXPECT_NEAR(world.radiance(view).mean(), through, 0.01) << angle << " rad";
        world.set_environment(1.0f);  // now all around, but behind the emitter
        EXPECT_NEAR(world.radiance(view).mean(), through + plate_reflectance(r, tint), 0.01) << angle << " rad";
      }
}

TEST(ThinGlass, that_is_clear_loses_nothing_however_rough) {
  for (const float ior : {1.1f, 1.5f, 2.0f})
    for (const float roughness : {0.0f, 0.1f, 0.4f, 0.7f, 1.0f})
      for (const double angle : {0.0, 1.1, pi + 0.5}) {
        World world;
        world.add(pane(50), sheet(ior, 1, roughness), placed({0, 0, 1}, angle));
        world.set_environment(1.0f);
        world.desc().samples_per_pixel = 128;
        EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 2000)).mean(), 1, 0.01) << ior << " " << roughness << " " << angle;
      }
}

TEST(ThinGlass, leaves_rays_straight) {
  // The border of a bright half plane stands in the same column with a tilted pane before it and without.
  double column[2];
  for (const bool glazed : {false, true}) {
    World world;
    world.add(quad({5, 0, 2}, {-5, 0, 0}, {0, 5, 0}), emitter(1.0f));
    if (glazed) world.add(pane(1), sheet(1.8f), placed({0, 0, 1}, 0.9));
    world.desc().samples_per_pixel = 1024;
    world.desc().max_bounces = 1;
    const Pixels image = world.radiance(view_at({0.003, 0, 0}, 33, 3, 2000));
    double bright = 0;
    for (uint32_t c = 0; c < 33; ++c) bright += image.at(0, 1, c);
    column[glazed] = 33 - bright / (glazed ? plate_transmittance(reflectance(0.9, 1.8), 1) : 1.0);
  }
  EXPECT_NEAR(column[1], column[0], 0.3);
  EXPECT_GT(column[0], 5);
}

// A wall at z = 1 with a lamp aside; a pane stands between them, not before the camera.
struct Lit {
  explicit Lit(uint32_t tracer = KUAFU_TRACER_AUTO) : world(tracer) {
    world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
    world.add_point({1.5, 0, 0.5}, 2.0f);
    world.desc().samples_per_pixel = 4;
    world.desc().max_bounces = 0;
  }
  void add_pane(const kuafu_material_desc& material, double x, double yaw = pi / 2) {
    world.add(pane(0.3), material, placed({x, 0, 0.75}, yaw));
  }
  double mean() { return world.radiance(view_at({0, 0, 0}, 9, 9, 2000)).mean(); }
  World world;
  double angle = std::atan2(0.5, 1.5);  // of the straight ray at a pane
};

TEST(ThinGlass, dims_a_lamp_behind_it_once) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    Lit open(tracer), one(tracer), two(tracer);
    kuafu_material_desc m = sheet(1.5f, 0.8f);
    m.attenuation_distance_m = 0.01f;  // of no body
    m.attenuation_color[0] = 0.1f;
    one.add_pane(m, 0.8);
    two.add_pane(m, 0.8);
    two.add_pane(sheet(1.3f), 0.4, -pi / 2);
    const double through = plate_transmittance(reflectance(one.angle, 1.5), 0.8);
    EXPECT_NEAR(one.mean() / open.mean(), through, 1e-3);
    EXPECT_NEAR(two.mean() / open.mean(), through * plate_transmittance(reflectance(one.angle, 1.3), 1), 1e-3);
    one.world.desc().glass_surfaces = 1;  // a sheet is one
    EXPECT_NEAR(one.mean() / open.mean(), through, 1e-3);
  }
}

TEST(ThinGlass, a_pattern_reaches_what_stands_behind_a_window) {
  World world;
  world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
  world.add(pane(0.5), sheet(1.5f), placed({0, 0, 0.5}));
  world.add_projector(std::vector<float>(64, 1.0f), 8, 8, 8, 1.0f);
  world.desc().samples_per_pixel = 256;
  const auto images = world.render({view_at({0, 0, 0}, 9, 9, 2000)}, {KUAFU_OUTPUT_PROJECTOR_DIRECT});
  const double through = plate_transmittance(reflectance(0, 1.5), 1);
  EXPECT_NEAR(images.at(KUAFU_OUTPUT_PROJECTOR_DIRECT).mean(), 0.5 / pi * through * through, 2e-3);
}

TEST(ThinGlass, has_the_same_fog_on_both_sides) {
  const auto fog = [](World& world) {
    kuafu_medium_desc m = kuafu_medium_desc_init();
    m.ir_extinction_per_m = 0.7f;
    m.ir_albedo = 0;
    ok(kuafu_scene_set_medium(world.scene(), &m));
  };
  for (const double yaw : {0.0, pi}) {
    World world;
    world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
    world.add(pane(1), sheet(1.0f), placed({0, 0, 1}, yaw));
    fog(world);
    world.desc().samples_per_pixel = 4;
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 4000)).mean(), std::exp(-1.4), 1e-4) << yaw;
  }
  Lit open, glazed;
  glazed.add_pane(sheet(1.0f), 0.8);
  fog(open.world);
  fog(glazed.world);
  EXPECT_NEAR(glazed.mean() / open.mean(), 1, 1e-3);
}

TEST(ThinGlass, inside_a_body_leaves_its_absorption) {
  World world;
  kuafu_material_desc body = glass(1.0f);  // no reflection, no bending
  body.attenuation_color[0] = 0.5f;
  body.attenuation_distance_m = 0.2f;
  world.add(box({1, 1, 0.1}), body, placed({0, 0, 1}));
  world.add(pane(0.5), sheet(1.0f), placed({0, 0, 1}));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = 4;
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 4000)).mean(), 0.5, 1e-3);
}

TEST(ThinGlass, light_samples_and_bsdf_samples_agree_through_frosted_panes) {
  expect_samplings_agree_through(pane(1), sheet(1.5f, 0.8f, 0.5f), 2048, 1);
}

}  // namespace
}  // namespace laws
