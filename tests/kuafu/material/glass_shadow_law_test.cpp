// SPDX-License-Identifier: Apache-2.0
// Light on its straight way through smooth glass (KUAFU_GLASS_SHADOWS_STRAIGHT): what a lamp or a projector gives to a surface behind a
// pane.
#include "kuafu/material/fresnel.h"
#include "kuafu/world.h"

namespace laws {
namespace {

/// A wall at z = 1 seen from the origin, a lamp 0.5 m before its centre and aside; panes stand between the lamp and the wall, not before
/// the camera.
struct Lit {
  explicit Lit(uint32_t tracer = KUAFU_TRACER_AUTO) : world(tracer) {
    world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
    world.add_point({1.5, 0, 0.5}, 2.0f);
    world.desc().samples_per_pixel = 4;
    world.desc().max_bounces = 0;
    world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_STRAIGHT;
  }
  void add_pane(kuafu_material_desc material, double x = 0.8) { world.add(box({0.01, 0.3, 0.3}), material, placed({x, 0, 0.75})); }
  double mean() { return world.radiance(view_at({0, 0, 0}, 9, 9, 2000)).mean(); }
  World world;
  double angle = std::atan2(0.5, 1.5);  // of the straight ray at a pane
};

TEST(GlassShadow, a_pane_dims_a_lamp_by_fresnel_at_both_faces) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    Lit open(tracer), shut(tracer), glazed(tracer);
    glazed.add_pane(glass(1.5f));
    shut.add_pane(lambert(0.5f));
    const double r = reflectance(open.angle, 1.5);
    EXPECT_NEAR(glazed.mean() / open.mean(), (1 - r) * (1 - r), 1e-3);
    EXPECT_EQ(shut.mean(), 0.0);
  }
}

TEST(GlassShadow, it_can_be_switched_off_and_is_bounded) {
  Lit lit;
  for (int i = 0; i < 3; ++i) lit.add_pane(glass(1.5f), 0.5 + 0.2 * i);
  const double r = reflectance(lit.angle, 1.5), through = lit.mean();
  Lit open;
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
  Lit lit, open;
  lit.add_pane(tinted);
  EXPECT_NEAR(lit.mean() / open.mean(), std::pow(0.8 * 0.5, 2), 1e-4);
}

TEST(GlassShadow, an_opaque_thing_behind_glass_still_casts_its_shadow) {
  Lit lit;
  lit.add_pane(glass(1.5f), 0.9);
  lit.add_pane(lambert(0.5f), 0.5);
  EXPECT_EQ(lit.mean(), 0.0);
}

TEST(GlassShadow, what_is_beyond_the_lamp_does_not_matter) {
  Lit lit, open;
  lit.add_pane(lambert(0.5f), 1.7);
  lit.add_pane(glass(1.5f));
  open.add_pane(glass(1.5f));
  EXPECT_DOUBLE_EQ(lit.mean(), open.mean());
}

TEST(GlassShadow, the_pattern_behind_glass_is_projector_direct) {
  World world;
  world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
  world.add(box({0.5, 0.5, 0.01}), glass(1.5f), placed({0, 0, 0.5}));
  world.add_projector(std::vector<float>(64, 1.0f), 8, 8, 8, 1.0f);
  world.desc().samples_per_pixel = 256;
  world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_STRAIGHT;
  auto images = world.render({view_at({0, 0, 0}, 9, 9, 2000)}, {KUAFU_OUTPUT_PROJECTOR_DIRECT});
  // Seen through the pane (all internal reflections), lit straight through it: rho / pi, 1 m, and camera at the projector.
  const double r = reflectance(0, 1.5);
  EXPECT_NEAR(images[KUAFU_OUTPUT_PROJECTOR_DIRECT].mean(), 0.5 / pi * (1 - r) * (1 - r) * (1 - r) / (1 + r), 2e-3);
}

TEST(GlassShadow, each_environment_of_a_batch_has_its_own_panes) {
  World world;
  world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
  world.add_point({1.5, 0, 0.5}, 2.0f);
  world.add(box({0.01, 0.3, 0.3}), glass(1.5f), placed({0.8, 0, 0.75}), 1);
  std::vector<kuafu_view_desc> views(3, view_at({0, 0, 0}, 9, 9, 2000));
  for (uint32_t e = 0; e < 3; ++e) views[e].environment = e;
  world.desc().samples_per_pixel = 1;
  world.desc().max_bounces = 0;
  world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_STRAIGHT;
  const Pixels image = world.render(views, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  const double r = reflectance(std::atan2(0.5, 1.5), 1.5);
  EXPECT_NEAR(image.at(1, 4, 4) / image.at(0, 4, 4), (1 - r) * (1 - r), 2e-3);
  EXPECT_NEAR(image.at(2, 4, 4) / image.at(0, 4, 4), 1, 1e-3);
}

}  // namespace
}  // namespace laws
