// SPDX-License-Identifier: Apache-2.0
// Glass: slabs, sheets and their shadows against Fresnel and Snell.
#include "kuafu/material/measured.h"

namespace laws {
namespace {

TEST(Glass, a_slab_transmits_and_reflects_what_fresnel_says) {
  // All internal reflections summed: T = (1 - R) / (1 + R).
  for (const bool reflected : {false, true})
    for (const double angle : {0.0, 0.5, 1.0, 1.3}) {
      World world;
      world.add(box({5, 5, 0.001}), glass(1.5f), placed({0, 0, 1}, angle));
      world.add(quad({0, 0, 20}, {-3, 0, 0}, {0, 3, 0}), emitter(reflected ? 0.0f : 1.0f));  // too small for what is reflected
      if (reflected) world.set_environment(1.0f);
      const double r = reflectance(angle, 1.5), expected = (reflected ? 2 * r : 1 - r) / (1 + r);
      EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 16, 16, 4000), 256, 40).mean(), expected, 0.01) << angle << " rad, " << reflected;
    }
}

TEST(Glass, a_tilted_slab_displaces_what_is_behind_it_as_snell_says) {
  // A plate of thickness t shifts a ray by t sin(a) (1 - cos(a) / (n cos(a'))): a bright edge there is seen at the image's centre.
  const double t = 0.05, angle = 0.7, n = 1.5;
  const double shift = t * std::sin(angle) * (1 - std::cos(angle) / std::sqrt(n * n - std::pow(std::sin(angle), 2)));
  World world;
  world.add(box({1, 1, t / 2}), glass(float(n)), placed({0, 0, 1}, angle));
  // Turned by +angle about y the plate's near face looks towards +x, so rays are moved towards +x or -x: the edge tells which.
  for (const double side : {-1.0, 1.0})
    world.add(quad({side * shift + 5, 0, 2}, {-5, 0, 0}, {0, 5, 0}), lambert(0.0f), placed({0, 0, 100}));
  const uint32_t emitter_id = world.add(quad({5, 0, 2}, {-5, 0, 0}, {0, 5, 0}), emitter(1.0f));
  world.take(64, 2);  // straight through
  const double focal_px = 2000;
  double edge[2];
  for (int i = 0; i < 2; ++i) {
    const auto pose = placed({i == 0 ? -shift : shift, 0, 0});
    ok(kuafu_scene_set_instance_pose(world.scene(), emitter_id, pose.data()));
    const Pixels image = world.radiance(view_at({0, 0, 0}, 65, 5, focal_px));
    double bright = 0;
    for (uint32_t c = 0; c < 65; ++c) bright += image.at(0, 2, c);
    edge[i] = 65 - bright / std::pow(1 - reflectance(angle, n), 2) - 0.5;  // column where the bright part begins
  }
  // One of the two lies at the centre, column 32; the other is off by twice the shift.
  const double nearest = std::min(std::abs(edge[0] - 32), std::abs(edge[1] - 32));
  EXPECT_LT(nearest, 0.3) << edge[0] << " " << edge[1];
  EXPECT_GT(std::abs(edge[0] - edge[1]), 20);
}

// A body of the air's own index is not there, however rough: light goes straight through, a lamp's and a shadow ray's too.
TEST(Glass, of_index_one_is_not_there) {
  for (const float roughness : {0.0f, 0.1f, 0.6f})
    for (const bool lamp : {false, true}) {
      World world;
      kuafu_material_desc m = glass(1.0f);
      m.roughness = m.transmission_roughness = roughness;
      world.add(box({5, 5, 0.1}), m, placed({0, 0, 1}, 0.3));
      world.add(quad({0, 0, 3}, {-4, 0, 0}, {0, 4, 0}), lamp ? lambert(1.0f) : emitter(1.0f));
      if (lamp) world.add_point({0, 0, 0}, float(9 * pi));  // on the wall's middle: irradiance pi
      EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 4000), 64).mean(), 1, 2e-3) << roughness << " " << lamp;
    }
}

TEST(Glass, total_internal_reflection_is_total) {
  // From inside a cube, 45 degrees to two pairs of walls, beyond the critical angle (41.8) of each: no light from outside comes in.
  World world;
  world.add(box({1, 1, 1}), glass(1.5f));
  world.set_environment(1.0f);
  world.desc().max_bounces = 12;
  EXPECT_EQ(world.radiance(view_at({0.1, 0, 0.2}, 8, 8, 500, pi / 4)).mean(), 0.0);
}

TEST(Glass, radiance_inside_is_n_squared_times_that_outside) {
  World world;
  world.add(box({1, 1, 1}), glass(1.5f));
  world.set_environment(1.0f);
  world.desc().max_bounces = 30;
  for (const float v : world.radiance(view_at({0.1, 0, 0.2}, 8, 8, 500)).values) ASSERT_NEAR(v, 2.25f, 0.01f);
}

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
        world.take(256, 1);
        const double r = reflectance(std::fmod(angle, pi), 1.5), through = plate_transmittance(r, tint);
        const kuafu_view_desc view = view_at({0, 0, 0}, 16, 16, 4000);
        EXPECT_NEAR(world.radiance(view).mean(), through, 0.01) << angle << " rad";
        world.set_environment(1.0f);  // now all around, but behind the emitter
        EXPECT_NEAR(world.radiance(view).mean(), through + plate_reflectance(r, tint), 0.01) << angle << " rad";
      }
}

TEST(ThinGlass, leaves_rays_straight) {
  // The border of a bright half plane stands in the same column with a tilted pane before it and without.
  double column[2];
  for (const bool glazed : {false, true}) {
    World world;
    world.add(quad({5, 0, 2}, {-5, 0, 0}, {0, 5, 0}), emitter(1.0f));
    if (glazed) world.add(pane(1), sheet(1.8f), placed({0, 0, 1}, 0.9));
    const Pixels image = world.radiance(view_at({0.003, 0, 0}, 33, 3, 2000), 1024, 1);
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
    world.take(4, 0);
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
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 4000), 4).mean(), std::exp(-1.4), 1e-4) << yaw;
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
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 4, 4, 4000), 4).mean(), 0.5, 1e-3);
}

TEST(ThinGlass, light_samples_and_bsdf_samples_agree_through_frosted_panes) {
  expect_samplings_agree_through(pane(1), sheet(1.5f, 0.8f, 0.5f), 2048, 1);
}

/// A wall at z = 1 seen from the origin, a lamp 0.5 m before its centre and aside; panes stand between lamp and wall alone.
struct BehindPanes : Lit {
  explicit BehindPanes(uint32_t tracer = KUAFU_TRACER_AUTO) : Lit(tracer) { world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_STRAIGHT; }
  void add_pane(kuafu_material_desc material, double x = 0.8) { world.add(box({0.01, 0.3, 0.3}), material, placed({x, 0, 0.75})); }
};

TEST(GlassShadow, a_pane_dims_a_lamp_by_fresnel_at_both_faces) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    BehindPanes open(tracer), shut(tracer), glazed(tracer);
    glazed.add_pane(glass(1.5f));
    shut.add_pane(lambert(0.5f));
    const double r = reflectance(open.angle, 1.5);
    EXPECT_NEAR(glazed.mean() / open.mean(), (1 - r) * (1 - r), 1e-3);
    EXPECT_EQ(shut.mean(), 0.0);
  }
}

TEST(GlassShadow, it_can_be_switched_off_and_is_bounded) {
  BehindPanes lit;
  for (int i = 0; i < 3; ++i) lit.add_pane(glass(1.5f), 0.5 + 0.2 * i);
  const double r = reflectance(lit.angle, 1.5), through = lit.mean();
  BehindPanes open;
  EXPECT_NEAR(through / open.mean(), std::pow(1 - r, 6), 1e-3);
  lit.world.desc().glass_surfaces = 6;
  EXPECT_DOUBLE_EQ(lit.mean(), through);
  for (const uint32_t surfaces : {5u, 0u}) {
    lit.world.desc().glass_surfaces = surfaces;
    EXPECT_EQ(lit.mean(), 0.0) << surfaces;
  }
}

TEST(GlassShadow, tint_and_partial_transmission_multiply) {
  kuafu_material_desc tinted = glass(1.0f);
  tinted.ir_albedo = 0.8f;
  tinted.transmission = 0.5f;
  BehindPanes lit, open;
  lit.add_pane(tinted);
  EXPECT_NEAR(lit.mean() / open.mean(), std::pow(0.8 * 0.5, 2), 1e-4);
}

TEST(GlassShadow, an_opaque_thing_behind_glass_still_casts_its_shadow) {
  BehindPanes lit;
  lit.add_pane(glass(1.5f), 0.9);
  lit.add_pane(lambert(0.5f), 0.5);
  EXPECT_EQ(lit.mean(), 0.0);
}

TEST(GlassShadow, what_is_beyond_the_lamp_does_not_matter) {
  BehindPanes lit, open;
  lit.add_pane(lambert(0.5f), 1.7);
  lit.add_pane(glass(1.5f));
  open.add_pane(glass(1.5f));
  EXPECT_DOUBLE_EQ(lit.mean(), open.mean());
}

// Seen through the pane (all internal reflections), lit through it: rho / pi, 1 m, and camera at the projector.
TEST(GlassShadow, the_pattern_behind_glass_is_projector_direct) {
  const auto direct = [](const Shape& shape, const kuafu_material_desc& material, uint32_t way) {
    World world;
    world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
    world.add(shape, material, placed({0, 0, 0.5}));
    world.add_projector(std::vector<float>(64, 1.0f), 8, 8, 8, 1.0f);
    world.desc().samples_per_pixel = 256;
    world.desc().glass_shadows = way;
    return world.image(view_at({0, 0, 0}, 9, 9, 2000), KUAFU_OUTPUT_PROJECTOR_DIRECT).mean();
  };
  const double r = reflectance(0, 1.5), through_sheet = plate_transmittance(r, 1);
  EXPECT_NEAR(direct(box({0.5, 0.5, 0.01}), glass(1.5f), KUAFU_GLASS_SHADOWS_STRAIGHT), 0.5 / pi * (1 - r) * (1 - r) * (1 - r) / (1 + r),
              2e-3);
  const uint32_t by_default = kuafu_render_desc_init().glass_shadows;
  EXPECT_NEAR(direct(pane(0.5), sheet(1.5f), by_default), 0.5 / pi * through_sheet * through_sheet, 2e-3);
}

TEST(GlassShadow, each_environment_of_a_batch_has_its_own_panes) {
  World world;
  world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
  world.add_point({1.5, 0, 0.5}, 2.0f);
  world.add(box({0.01, 0.3, 0.3}), glass(1.5f), placed({0.8, 0, 0.75}), 1);
  std::vector<kuafu_view_desc> views(3, view_at({0, 0, 0}, 9, 9, 2000));
  for (uint32_t e = 0; e < 3; ++e) views[e].environment = e;
  world.take(1, 0);
  world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_STRAIGHT;
  const Pixels image = world.render(views, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  const double r = reflectance(std::atan2(0.5, 1.5), 1.5);
  EXPECT_NEAR(image.at(1, 4, 4) / image.at(0, 4, 4), (1 - r) * (1 - r), 2e-3);
  EXPECT_NEAR(image.at(2, 4, 4) / image.at(0, 4, 4), 1, 1e-3);
}

}  // namespace
}  // namespace laws
