// SPDX-License-Identifier: Apache-2.0
// Surfaces that are not everywhere there: what a camera, a path and a shadow ray find of them, with every tracer.
#include <optional>
#include <string>
#include <vector>

#include "kuafu/world.h"

namespace laws {
namespace {

uint32_t add_alpha_texture(World& world, const std::vector<uint8_t>& alpha, uint32_t width) {
  std::vector<uint8_t> texels;
  for (const uint8_t a : alpha) texels.insert(texels.end(), {255, 255, 255, a});
  kuafu_texture_desc t = texture_of(texels, width, 4);
  t.filter = KUAFU_FILTER_NEAREST;
  return world.add_texture(t);
}

kuafu_material_desc with_alpha(uint32_t mode, float alpha) {
  kuafu_material_desc m = lambert(0);
  m.alpha_mode = mode;
  m.base_color[3] = alpha;
  return m;
}

class Alpha : public testing::TestWithParam<uint32_t> {
 protected:
  void SetUp() override { SKIP_IF(why_not(GetParam())); }
};

TEST_P(Alpha, a_mask_has_holes_for_depth_light_and_shadows) {
  World world(GetParam());
  kuafu_material_desc m = with_alpha(KUAFU_ALPHA_MASK, 1);
  m.alpha_cutoff = 100 / 255.0f;
  m.base_color_texture = add_alpha_texture(world, {99, 101, 255, 0}, 2);  // holes at the upper left and the lower right
  world.add(uv_wall(1), m);
  world.add(uv_wall(2), lambert(1));
  world.add_point({0, 0, 0}, float(4 * pi));
  world.take(1, 0);
  auto images = world.render({view_at({0, 0, 0}, 32, 32, 16)}, {KUAFU_OUTPUT_DEPTH, KUAFU_OUTPUT_RADIANCE});
  for (const uint32_t row : {4u, 12u, 20u, 28u})
    for (const uint32_t column : {4u, 12u, 20u, 28u}) {
      const bool hole = (row < 16) == (column < 16);
      EXPECT_NEAR(images[KUAFU_OUTPUT_DEPTH].at(0, row, column), hole ? 2 : 1, 1e-5) << row << " " << column;
      const double x = (column - 15.5) / 16, y = (row - 15.5) / 16, slant = 1 + x * x + y * y;
      EXPECT_NEAR(images[KUAFU_OUTPUT_RADIANCE].at(0, row, column), hole ? std::pow(slant, -1.5) : 0, 0.08);  // one sample in the pixel
    }
}

TEST_P(Alpha, blended_light_and_shadow_are_in_the_mean_what_alpha_says) {
  constexpr double alpha = 0.3;
  World world(GetParam());
  world.add(quad({0, 0, 1}, {9, 0, 0}, {0, -9, 0}), with_alpha(KUAFU_ALPHA_BLEND, float(alpha)));
  world.add(quad({0, 0, 2}, {9, 0, 0}, {0, -9, 0}), lambert(1));
  world.add_point({0, 0, 0}, float(4 * pi));
  world.take(256, 0);
  // The camera's ray passes with 0.7, and so does the ray from the wall to the light.
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 16, 16, 800)).mean(), 0.7 * 0.7, 0.01);
  // Behind the sheet the camera sees the shadow alone.
  const Pixels shadow = world.radiance(view_at({0, 0, 1.5}, 16, 16, 800));
  EXPECT_NEAR(shadow.mean(), 0.7, 0.015);
  EXPECT_EQ(shadow.values, world.radiance(view_at({0, 0, 1.5}, 16, 16, 800)).values) << "the same seed gives the same image";
}

TEST_P(Alpha, a_sheet_takes_its_share_of_the_light_from_behind) {
  World world(GetParam());
  world.set_environment(1);
  world.add(quad({0, 0, 50}, {400, 0, 0}, {0, -400, 0}), lambert(1));
  world.add(quad({0, 0, 1}, {0.01, 0, 0}, {0, -0.01, 0}), with_alpha(KUAFU_ALPHA_BLEND, 0.6f));
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 12, 12, 2000), 256).mean(), 0.4, 0.02);
}

TEST_P(Alpha, an_opaque_material_pays_no_heed_to_alpha_and_one_that_changes_is_followed) {
  World world(GetParam());
  world.add(uv_wall(1), with_alpha(KUAFU_ALPHA_OPAQUE, 0));
  world.add(uv_wall(2), lambert(1));
  const auto depth = [&] { return world.image(view_at({0, 0, 0}, 4, 4, 4), KUAFU_OUTPUT_DEPTH).at(0, 1, 1); };
  EXPECT_NEAR(depth(), 1, 1e-5);
  kuafu_material_desc masked = with_alpha(KUAFU_ALPHA_MASK, 0);
  ok(kuafu_scene_set_material(world.scene(), 1, &masked));
  EXPECT_NEAR(depth(), 2, 1e-5);
  masked.base_color[3] = 1;
  ok(kuafu_scene_set_material(world.scene(), 1, &masked));
  EXPECT_NEAR(depth(), 1, 1e-5);
}

TEST_P(Alpha, a_shining_surface_gives_what_is_there_of_it) {
  double means[2];
  for (const bool half : {false, true}) {
    World world(GetParam());
    kuafu_material_desc m = emitter(10);
    m.alpha_mode = half ? KUAFU_ALPHA_BLEND : KUAFU_ALPHA_OPAQUE;
    m.base_color[3] = 0.5f;
    world.add(quad({0, -1, 2}, {0.3, 0, 0}, {0, 0, 0.3}), m);
    world.add(quad({0, 1, 2}, {3, 0, 0}, {0, 0, -3}), lambert(1));
    means[half] = world.radiance(view_at({0, 0.2, 0}, 16, 16, 30), 64, 1).mean();
  }
  EXPECT_GT(means[0], 0.01);
  EXPECT_NEAR(means[1] / means[0], 0.5, 0.03);
}

uint32_t seeds_of(uint32_t tracer) { return tracer == KUAFU_TRACER_EMBREE ? 24 : 2; }

/// Light of a lamp on a wall through a pane of glass: without a sheet beside the pane, else with sheets of some alphas.
std::vector<double> light_past(uint32_t tracer, uint32_t glass_shadows, std::optional<double> sheet_x,
                               const std::vector<kuafu_material_desc>& sheets) {
  World world(tracer);
  if (sheet_x) world.add(quad({*sheet_x, 0, 0.75}, {0, 0.3, 0}, {0, 0, 0.3}), sheets[0]);
  world.add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
  world.add(box({0.01, 0.3, 0.3}), glass(1.5f), placed({0.8, 0, 0.75}));
  world.add_point({1.5, 0, 0.5}, 2.0f);
  world.desc().glass_shadows = glass_shadows;
  std::vector<double> means;
  for (const kuafu_material_desc& sheet : sheets) {
    if (sheet_x) ok(kuafu_scene_set_material(world.scene(), 1, &sheet));
    // Bent light comes in beams, each of which meets a sheet or does not: a view and seeds for hundreds of them.
    double sum = 0;
    for (uint32_t seed = 0; seed < seeds_of(tracer); ++seed) {
      world.desc().seed = seed;
      sum += world.radiance(view_at({0, 0, 0}, 9, 9, 60), 16, 0).mean();
    }
    means.push_back(sum / seeds_of(tracer));
  }
  return means;
}

TEST_P(Alpha, shadow_rays_through_glass_agree_about_what_is_there) {
  const std::vector sheets{with_alpha(KUAFU_ALPHA_MASK, 0), with_alpha(KUAFU_ALPHA_MASK, 1), with_alpha(KUAFU_ALPHA_BLEND, 0.3f)};
  for (const uint32_t way : {KUAFU_GLASS_SHADOWS_STRAIGHT, KUAFU_GLASS_SHADOWS_BENT}) {
    const double without = light_past(GetParam(), way, std::nullopt, {sheets[0]})[0];
    for (const double x : {0.3, 1.2}) {
      SCOPED_TRACE("sheet at " + std::to_string(x) + " way " + std::to_string(way));
      const std::vector<double> past = light_past(GetParam(), way, x, sheets);
      EXPECT_NEAR(past[0] / without, 1, 1e-3);
      EXPECT_EQ(past[1], 0);
      EXPECT_NEAR(past[2] / without, 0.7, GetParam() == KUAFU_TRACER_EMBREE ? 0.03 : 0.12);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Tracers, Alpha, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE, KUAFU_TRACER_RT_PIPELINE));

}  // namespace
}  // namespace laws
