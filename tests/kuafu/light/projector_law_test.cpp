// SPDX-License-Identifier: Apache-2.0
// Projectors: where their pattern lands, how bright, through which lens.
#include "kuafu/light/spot.h"

namespace laws {
namespace {

const std::vector<float> uniform_pattern(9 * 9, 1.0f);

// Camera and projector at one point, so nothing is shadowed.
double centre_radiance(double distance_m, double tilt) {
  World world;
  world.add(quad({0, 0, 0}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f), placed({0, 0, distance_m}, tilt));
  world.add_projector(uniform_pattern, 9, 9, 4, 3.0f);
  return world.radiance(view_at({0, 0, 0}, 1, 1, 1000), 4, 0).at(0, 0, 0);
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
  world.take(64, 0);
  const kuafu_view_desc view = view_at({0, 0, 0}, 160, 120, 150);
  const Pixels image = world.image(view, KUAFU_OUTPUT_PROJECTOR_DIRECT);
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
  EXPECT_EQ(world.radiance(visible(view_at({0, 0, 0}, 4, 4, 100))).mean(), 0.0);
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
  EXPECT_NEAR(world.radiance(view, 256).mean(), sum, 0.01 * sum);
}

constexpr uint32_t side = 33;
constexpr double focal_px = 60;

kuafu_light_desc projector_of(World& world, const std::vector<float>& pattern) { return world.projector(pattern, side, side, focal_px, 1); }

Spot spot_on_wall(World& world, double distance_m) { return spot_on_wall(world, distance_m, side, focal_px); }

std::vector<float> dot_at(uint32_t u, uint32_t v) {
  std::vector<float> pattern(size_t(side) * side, 0.0f);
  pattern[size_t(v) * side + u] = 1;
  return pattern;
}

TEST(ProjectorLens, distortion_is_brown_and_conradys) {
  World world;
  kuafu_light_desc light = projector_of(world, dot_at(27, 22));
  const double k[8] = {0.3, -0.1, 0.01, -0.015, 0.02, 0, 0, 0};
  std::copy(k, k + 8, light.lens.distortion);
  world.add_light(light, placed({0, 0, 0}));
  const Spot spot = spot_on_wall(world, 1.0);
  const double x = spot.x, y = spot.y, r2 = x * x + y * y;  // OpenCV's formula, from where it is seen to its pixel
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  EXPECT_NEAR(focal_px * (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x)) + 16, 27, 0.03);
  EXPECT_NEAR(focal_px * (y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y) + 16, 22, 0.03);
}

TEST(ProjectorLens, falloff_is_a_power_of_the_cosine) {
  for (const double n : {1.0, 4.0}) {
    double powers[2];
    for (const bool falls : {false, true}) {
      World world;
      kuafu_light_desc light = projector_of(world, dot_at(30, 28));
      light.falloff = falls ? n : 0;
      world.add_light(light, placed({0, 0, 0}));
      powers[falls] = spot_on_wall(world, 0.8).power;
    }
    const double x = 14 / focal_px, y = 12 / focal_px;
    EXPECT_NEAR(powers[1] / powers[0], std::pow(1 + x * x + y * y, -n / 2), 2e-3) << n;
  }
}

// A uniform disc of radius R has a mean square radius of R^2 / 2; it comes on top of the dot's own bilinear tent.
TEST(ProjectorLens, defocus_spreads_by_the_circle_of_confusion) {
  for (const double distance : {0.5, 1.0, 2.0}) {
    Spot spots[2];
    for (const bool blurred : {false, true}) {
      World world;
      kuafu_light_desc light = projector_of(world, dot_at(16, 16));
      light.radius_m = blurred ? 0.02 : 0;
      light.focus_m = 0.8;
      world.add_light(light, placed({0, 0, 0}));
      spots[blurred] = spot_on_wall(world, distance);
    }
    const double radius = 0.02 * std::abs(1 / distance - 1 / 0.8);  // tangent
    EXPECT_NEAR(spots[1].spread - spots[0].spread, radius * radius / 2, 0.03 * radius * radius + 2e-7) << distance;
    EXPECT_NEAR(spots[1].power / spots[0].power, 1, 0.01) << distance;
  }
}

// A shining plate in the middle of an absorbing block: what is seen has gone through half of it.
TEST(Absorption, of_an_immersed_object_is_that_of_the_way_inside) {
  for (const double depth : {0.1, 0.3}) {
    World world;
    kuafu_material_desc m = glass(1.0f);
    m.ir_attenuation_color = 0.4f;
    m.attenuation_distance_m = 0.25f;
    world.add(box({1, 1, 0.5}), m, placed({0, 0, 2}));
    world.add(quad({0, 0, 1.5 + depth}, {-0.5, 0, 0}, {0, 0.5, 0}), emitter(1.0f));
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 4000), 4).mean(), std::pow(0.4, depth / 0.25), 1e-3) << depth;
  }
}

}  // namespace
}  // namespace laws
