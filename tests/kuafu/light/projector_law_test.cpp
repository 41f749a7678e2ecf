// SPDX-License-Identifier: Apache-2.0
// The projector: inverse square, cosine, where its pattern falls, and how its light is split into groups.
#include "kuafu/world.h"

namespace laws {
namespace {

const std::vector<float> uniform_pattern(9 * 9, 1.0f);

// Camera and projector at one point, so nothing is shadowed.
double centre_radiance(double distance_m, double tilt) {
  World world;
  world.add(quad({0, 0, 0}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f), placed({0, 0, distance_m}, tilt));
  world.add_projector(uniform_pattern, 9, 9, 4, 3.0f);
  world.desc().samples_per_pixel = 4;
  world.desc().max_bounces = 0;
  return world.radiance(view_at({0, 0, 0}, 1, 1, 1000)).at(0, 0, 0);
}

TEST(Projector, irradiance_falls_with_the_square_of_distance) {
  for (const double d : {0.25, 0.5, 1.0, 2.0, 8.0}) {
    const double expected = 0.5 / pi * 3.0 / (d * d);
    EXPECT_NEAR(centre_radiance(d, 0), expected, 1e-3 * expected) << d << " m";
  }
}

TEST(Projector, irradiance_falls_with_the_cosine) {
  for (const double angle : {0.3, 0.6, 1.0, 1.3}) {
    const double expected = 0.5 / pi * 3.0 * std::cos(angle);
    EXPECT_NEAR(centre_radiance(1, angle), expected, 3e-3 * expected) << angle << " rad";
  }
}

TEST(Projector, pattern_lands_where_projection_says) {
  // Projector 60 mm to the right of the camera; one bright texel; plane at 0.8 m.
  const uint32_t w = 33, h = 25, bright_u = 20, bright_v = 9;
  const double focal_px = 40, z = 0.8, baseline = 0.06;
  std::vector<float> pattern(w * h, 0.0f);
  pattern[bright_v * w + bright_u] = 1.0f;
  World world;
  world.add(quad({0, 0, z}, {-2, 0, 0}, {0, 2, 0}), lambert(0.8f));
  world.add_projector(pattern, w, h, focal_px, 1.0f, placed({baseline, 0, 0}));
  world.desc().samples_per_pixel = 64;
  world.desc().max_bounces = 0;
  const kuafu_view_desc view = view_at({0, 0, 0}, 160, 120, 150);
  const Pixels image = world.render({view}, {KUAFU_OUTPUT_PROJECTOR_DIRECT})[KUAFU_OUTPUT_PROJECTOR_DIRECT];
  double sum = 0, sum_u = 0, sum_v = 0;
  for (uint32_t r = 0; r < image.height; ++r)
    for (uint32_t c = 0; c < image.width; ++c) {
      sum += image.at(0, r, c);
      sum_u += c * image.at(0, r, c);
      sum_v += r * image.at(0, r, c);
    }
  const double x = (bright_u - (w - 1) / 2.0) / focal_px * z + baseline, y = (bright_v - (h - 1) / 2.0) / focal_px * z;
  EXPECT_NEAR(sum_u / sum, 150 * x / z + 79.5, 0.05);
  EXPECT_NEAR(sum_v / sum, 150 * y / z + 59.5, 0.05);
  // The bilinear tent reaches one texel to each side and nothing beyond.
  const int lit_left = int(std::ceil(150 * ((bright_u - 1.0 - (w - 1) / 2.0) / focal_px + baseline / z) + 79.5 + 0.5));
  EXPECT_EQ(image.at(0, 42, uint32_t(lit_left) - 2), 0.0f);
  EXPECT_GT(image.at(0, uint32_t(std::lround(sum_v / sum)), uint32_t(std::lround(sum_u / sum))), 0.0f);
}

TEST(Projector, is_dark_in_the_visible_band_by_default) {
  World world;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f));
  world.add_projector(uniform_pattern, 9, 9, 4, 3.0f);
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 100);
  view.band = KUAFU_BAND_VISIBLE;
  EXPECT_EQ(world.radiance(view).mean(), 0.0);
}

TEST(Projector, light_groups_sum_to_radiance) {
  World world;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  world.add(quad({0, 0.4, 0.6}, {-1, 0, 0}, {0, 0, -0.6}), lambert(0.7f));
  world.add(sphere(0.2, 12, true, {0.1, 0.1, 0.7}), glass(1.5f));
  world.add_projector(uniform_pattern, 9, 9, 8, 3.0f, placed({0.05, 0, 0}));
  world.add_point({-0.5, -0.5, 0}, 0.3f);
  world.set_environment(0.2f);
  auto images = world.render({view_at({0, 0, 0}, 48, 32, 40)},
                             {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_PROJECTOR_INDIRECT, KUAFU_OUTPUT_AMBIENT});
  const auto& [direct, indirect, ambient] =
      std::tie(images[KUAFU_OUTPUT_PROJECTOR_DIRECT], images[KUAFU_OUTPUT_PROJECTOR_INDIRECT], images[KUAFU_OUTPUT_AMBIENT]);
  EXPECT_GT(direct.mean(), 0.01);
  EXPECT_GT(indirect.mean(), 1e-4);
  EXPECT_GT(ambient.mean(), 0.01);
  const Pixels& radiance = images[KUAFU_OUTPUT_RADIANCE];
  for (size_t i = 0; i < radiance.values.size(); ++i)
    ASSERT_NEAR(radiance.values[i], direct.values[i] + indirect.values[i] + ambient.values[i], 1e-5f * (1 + radiance.values[i])) << i;
  const Pixels alone = world.render({view_at({0, 0, 0}, 48, 32, 40)}, {KUAFU_OUTPUT_PROJECTOR})[KUAFU_OUTPUT_PROJECTOR];
  for (size_t i = 0; i < alone.values.size(); ++i) ASSERT_EQ(alone.values[i], direct.values[i] + indirect.values[i]) << i;
}

TEST(Projector, direct_light_through_smooth_glass_and_mirrors_is_direct) {
  World world;
  world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  world.add(box({0.3, 0.3, 0.01}, {0, 0, 0.2}), glass(1.5f));
  world.add_projector(uniform_pattern, 9, 9, 8, 3.0f, placed({0, 0, 0.3}));  // behind the pane, in front of the wall
  auto images = world.render({view_at({0, 0, 0}, 8, 8, 40)}, {KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_PROJECTOR_INDIRECT});
  EXPECT_GT(images[KUAFU_OUTPUT_PROJECTOR_DIRECT].mean(), 0.5);
}

TEST(Lights, choosing_one_of_many_by_power_is_unbiased) {
  // Twelve lights of very different power together against the sum of each alone.
  const auto build = [](World& world, int only) {
    world.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
    for (int i = 0; i < 12; ++i)
      if (only < 0 || only == i) world.add_point({0.3 * std::cos(i), 0.3 * std::sin(i), 0.2 + 0.03 * i}, 0.01f * float(i * i + 1));
    world.desc().max_bounces = 0;
  };
  const kuafu_view_desc view = view_at({0, 0, 0}, 16, 16, 40);
  double sum = 0;
  for (int i = 0; i < 12; ++i) {
    World world;
    build(world, i);
    sum += world.radiance(view).mean();
  }
  World world;
  build(world, -1);
  world.desc().samples_per_pixel = 256;
  EXPECT_NEAR(world.radiance(view).mean(), sum, 0.01 * sum);
}

}  // namespace
}  // namespace laws
