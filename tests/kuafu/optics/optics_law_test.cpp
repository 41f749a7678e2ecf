// SPDX-License-Identifier: Apache-2.0
// Optics: their closed forms, on host stages and in Vulkan compute.
#include <algorithm>

#include "kuafu/world.h"

namespace laws {
namespace {

constexpr uint32_t side = 41;
constexpr double focal_px = 40.0;

class CameraOptics : public testing::TestWithParam<uint32_t> {
 protected:
  CameraOptics() : world_(GetParam()) { world_.take(1, 0); }

  /// A light that fills one pixel, at z = 1 m; radiance in W/(sr m^2).
  void add_point_at(uint32_t column, uint32_t row, double z = 1.0, float radiance = 1.0f) {
    const double half = 0.5 * z / focal_px * 0.999;
    world_.add(quad({(column - 20.0) * z / focal_px, (row - 20.0) * z / focal_px, z}, {-half, 0, 0}, {0, half, 0}), emitter(radiance));
  }
  void add_wall(float radiance, double z = 2.0, double first_x = -40.0) {
    world_.add(quad({first_x + 40.0, 0, z}, {-40, 0, 0}, {0, 40, 0}), emitter(radiance));
  }

  std::map<uint32_t, Pixels> render(const kuafu_optics_desc* optics, const std::vector<uint32_t>& outputs = {KUAFU_OUTPUT_RADIANCE}) {
    kuafu_view_desc view = view_at({0, 0, 0}, side, side, focal_px);
    view.optics = optics;
    return world_.render({view}, outputs);
  }
  Pixels image(const kuafu_optics_desc& optics) { return render(&optics)[KUAFU_OUTPUT_RADIANCE]; }

  World world_;
};

struct Moments {
  double sum, column, row, column_variance, row_variance;
};

Moments moments(const Pixels& image) {
  Moments m{};
  for (uint32_t r = 0; r < side; ++r)
    for (uint32_t c = 0; c < side; ++c) {
      const double value = image.at(0, r, c);
      m.sum += value;
      m.column += value * c;
      m.row += value * r;
      m.column_variance += value * c * c;
      m.row_variance += value * r * r;
    }
  m.column /= m.sum;
  m.row /= m.sum;
  m.column_variance = m.column_variance / m.sum - m.column * m.column;
  m.row_variance = m.row_variance / m.sum - m.row * m.row;
  return m;
}

TEST_P(CameraOptics, neutral_optics_keep_every_bit) {
  world_.add(sphere(0.5, 16, false), lambert(0.7f), placed({0.1, 0, 2}));
  world_.add_point({0.5, -1, 0}, 5);
  world_.set_environment(0.3f);
  const kuafu_optics_desc neutral = kuafu_optics_desc_init();
  EXPECT_EQ(image(neutral).values, render(nullptr)[KUAFU_OUTPUT_RADIANCE].values);
  // Beside a view that is not neutral, too.
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.psf_sigma_px = 1;
  optics.vignetting_exponent = 4;
  optics.defocus_lens_radius_m = 0.1;
  optics.veiling_glare_fraction = 0.1;
  kuafu_view_desc views[2] = {view_at({0, 0, 0}, side, side, focal_px), view_at({0, 0, 0}, side, side, focal_px)};
  views[0].optics = &optics;
  const Pixels both = world_.render({views[0], views[1]}, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  const Pixels alone = world_.radiance(views[1]);
  EXPECT_TRUE(std::equal(alone.values.begin(), alone.values.end(), both.values.begin() + side * side));
}

TEST_P(CameraOptics, vignetting_is_cosine_to_the_fourth) {
  add_wall(3);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.vignetting_exponent = 4;
  const Pixels seen = image(optics);
  for (uint32_t r = 0; r < side; ++r)
    for (uint32_t c = 0; c < side; ++c) {
      const double x = (c - 20.0) / focal_px, y = (r - 20.0) / focal_px, cosine = 1 / std::sqrt(1 + x * x + y * y);
      ASSERT_NEAR(seen.at(0, r, c), 3 * std::pow(cosine, 4), 3e-6) << c << " " << r;
    }
}

TEST_P(CameraOptics, vignetting_follows_the_ray_through_a_distorting_lens) {
  add_wall(1);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.vignetting_exponent = 4;
  kuafu_view_desc view = view_at({0, 0, 0}, side, side, focal_px);
  view.optics = &optics;
  view.camera.lens.distortion[0] = -0.15;
  const Pixels seen = world_.radiance(view);
  for (uint32_t c = 20; c < side; ++c) {
    const double appears = (c - 20.0) / focal_px;
    double x = appears;
    for (int i = 0; i < 30; ++i) x = appears / (1 - 0.15 * x * x);
    ASSERT_NEAR(seen.at(0, 20, c), std::pow(1 + x * x, -2), 1e-5) << c;
  }
}

TEST_P(CameraOptics, vignetting_polynomial_in_the_field_s_radius) {
  add_wall(1);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.vignetting_polynomial[0] = -0.5;
  optics.vignetting_polynomial[1] = 0.25;
  optics.vignetting_polynomial[2] = -1.5;
  const Pixels seen = image(optics);
  EXPECT_EQ(seen.at(0, 20, 20), 1.0f);
  EXPECT_EQ(seen.at(0, 0, 0), 0.0f);                                       // 1 - 1.75 is no light
  EXPECT_NEAR(seen.at(0, 20, 0), 1 - 0.5 / 2 + 0.25 / 4 - 1.5 / 8, 1e-6);  // fx = -1: r^2 = 1/2
  EXPECT_NEAR(seen.at(0, 10, 30), 1 - 0.5 / 4 + 0.25 / 16 - 1.5 / 64, 1e-6);
}

TEST_P(CameraOptics, psf_has_its_variance_and_keeps_energy) {
  add_point_at(20, 20);
  for (const double sigma : {0.2, 0.5, 1.0, 2.3}) {
    kuafu_optics_desc optics = kuafu_optics_desc_init();
    optics.psf_sigma_px = sigma;
    const Moments m = moments(image(optics));
    EXPECT_NEAR(m.sum, 1, 2e-6) << sigma;
    EXPECT_NEAR(m.column, 20, 1e-5) << sigma;
    EXPECT_NEAR(m.column_variance, sigma * sigma, 2e-4 * sigma * sigma) << sigma;
    EXPECT_NEAR(m.row_variance, sigma * sigma, 2e-4 * sigma * sigma) << sigma;
  }
}

TEST_P(CameraOptics, psf_grows_over_the_field_and_keeps_energy) {
  add_point_at(28, 14);
  const double r2 = (0.4 * 0.4 + 0.3 * 0.3) / 2;
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.psf_sigma_px = 0.8;
  optics.psf_corner_sigma_px = 6;
  const Moments m = moments(image(optics));
  const double variance = 0.8 * 0.8 + 36 * r2 * r2;
  EXPECT_NEAR(m.sum, 1, 2e-5);
  EXPECT_NEAR(m.column_variance, variance, 0.02 * variance);
  EXPECT_NEAR(m.row_variance, variance, 0.06 * variance);  // the second pass starts where the first one left the light
}

TEST_P(CameraOptics, light_beyond_the_border_is_the_nearest_pixel_s) {
  add_wall(2);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.psf_sigma_px = 3;
  optics.defocus_lens_radius_m = 0.2;
  optics.defocus_focus_m = 1;
  for (const float value : image(optics).values) ASSERT_NEAR(value, 2, 1e-5);
}

// Of a disc with a rim one pixel wide, a mixture of discs of radii r - 1/2 .. r + 1/2 by area: E[x^2] = E[rho^4] / (4 E[rho^2]).
double disc_variance(double r) { return (std::pow(r, 4) + r * r / 2 + 1.0 / 80) / (4 * (r * r + 1.0 / 12)); }

TEST_P(CameraOptics, circle_of_confusion_grows_with_defocus) {
  add_wall(0, 1.0);  // keeps the depth the same all over
  add_point_at(20, 20, 0.9999);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.defocus_lens_radius_m = 0.1;
  for (const double focus : {0.5, 2.0, 4.0, double(INFINITY), 1.0}) {
    optics.defocus_focus_m = focus;
    const double radius = focal_px * 0.1 * std::abs(1 - 1 / focus);
    const Moments m = moments(image(optics));
    EXPECT_NEAR(m.sum, 1, 0.02) << focus;
    EXPECT_NEAR(m.column_variance, radius < 0.5 ? 0 : disc_variance(radius), 0.03 * radius * radius) << focus;
  }
}

TEST_P(CameraOptics, sharp_edge_stays_sharp_before_a_blurred_background_and_not_the_other_way) {
  add_wall(0, 1.0, 0.0);  // the right half is near and dark
  add_wall(1, 4.0);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.defocus_lens_radius_m = 0.1;
  optics.defocus_focus_m = 1;  // 3 px at 4 m
  Pixels seen = image(optics);
  EXPECT_EQ(seen.at(0, 20, 21), 0.0f);
  EXPECT_NEAR(seen.at(0, 20, 10), 1, 1e-5);
  optics.defocus_focus_m = 4;  // now the near half is blurred, over the far one
  seen = image(optics);
  EXPECT_LT(seen.at(0, 20, 19), 0.9f);
  EXPECT_GT(seen.at(0, 20, 19), 0.3f);
  EXPECT_NEAR(seen.at(0, 20, 12), 1, 1e-5);
}

TEST_P(CameraOptics, veiling_glare_keeps_the_mean_and_is_even) {
  add_point_at(7, 30);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.veiling_glare_fraction = 0.2;
  const Pixels seen = image(optics);
  const double mean = 1.0 / (side * side);
  EXPECT_NEAR(seen.mean(), mean, 1e-8);
  EXPECT_NEAR(seen.at(0, 30, 7), 0.8 + 0.2 * mean, 1e-6);
  EXPECT_NEAR(seen.at(0, 0, 0), 0.2 * mean, 1e-8);
}

TEST_P(CameraOptics, lone_bright_pixels_and_pairs_go_and_everything_else_stays) {
  add_wall(1);
  for (const auto& [column, row] : {std::pair{10u, 10u}, {25u, 30u}, {26u, 30u}, {0u, 0u}, {40u, 17u}}) add_point_at(column, row, 1, 50);
  for (uint32_t i = 0; i < 25; ++i) add_point_at(30 + i % 5, 5 + i / 5, 1, 50);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  const Pixels spoilt = image(optics);
  optics.firefly_factor = 1.5;
  const Pixels seen = image(optics);
  for (uint32_t r = 0; r < side; ++r)
    for (uint32_t c = 0; c < side; ++c) {
      const bool in_block = c >= 30 && c < 35 && r >= 5 && r < 10;
      ASSERT_EQ(seen.at(0, r, c), in_block ? 50.0f : 1.0f) << c << " " << r;
    }
  EXPECT_EQ(spoilt.at(0, 0, 0), 50.0f);
  optics.firefly_factor = 60;  // none is so bright
  EXPECT_EQ(image(optics).values, spoilt.values);
}

TEST_P(CameraOptics, light_straight_from_the_projector_is_no_firefly) {
  world_.add(quad({0, 0, 2}, {-4, 0, 0}, {0, 4, 0}), lambert(0.8f));
  world_.add_projector(dotted(17 * 17), 17, 17, 40, 30);
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  const Pixels dotted = image(optics);
  optics.firefly_factor = 1;
  EXPECT_EQ(image(optics).values, dotted.values);
  EXPECT_GT(std::ranges::max(dotted.values), 5 * dotted.mean());
  add_point_at(3, 3, 1, 50);
  const Pixels seen = image(optics);
  EXPECT_LT(seen.at(0, 3, 3), 1.0f);
}

kuafu_optics_desc everything() {
  kuafu_optics_desc optics = kuafu_optics_desc_init();
  optics.vignetting_exponent = 3;
  optics.vignetting_polynomial[0] = -0.1;
  optics.defocus_lens_radius_m = 0.1;
  optics.psf_sigma_px = 0.7;
  optics.psf_corner_sigma_px = 1.5;
  optics.veiling_glare_fraction = 0.05;
  return optics;
}

TEST_P(CameraOptics, light_groups_still_sum_to_the_image) {
  world_.add(sphere(0.5, 16, false), lambert(0.7f), placed({0.1, 0, 2}));
  add_wall(0.1f, 3.0);
  world_.add_point({0.5, -1, 0}, 5);
  world_.add_projector(std::vector<float>(81, 1.0f), 9, 9, 4, 3, placed({0.05, 0, 0}));
  world_.set_environment(0.3f);
  world_.desc().max_bounces = 3;
  const kuafu_optics_desc optics = everything();
  auto images = render(&optics, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_PROJECTOR_INDIRECT,
                                 KUAFU_OUTPUT_AMBIENT, KUAFU_OUTPUT_PROJECTOR});
  for (size_t i = 0; i < side * side; ++i) {
    const float sum = images[KUAFU_OUTPUT_PROJECTOR_DIRECT].values[i] + images[KUAFU_OUTPUT_PROJECTOR_INDIRECT].values[i] +
                      images[KUAFU_OUTPUT_AMBIENT].values[i];
    ASSERT_NEAR(images[KUAFU_OUTPUT_RADIANCE].values[i], sum, 2e-6 * (1 + sum));
    ASSERT_EQ(images[KUAFU_OUTPUT_PROJECTOR].values[i],
              images[KUAFU_OUTPUT_PROJECTOR_DIRECT].values[i] + images[KUAFU_OUTPUT_PROJECTOR_INDIRECT].values[i]);
  }
}

INSTANTIATE_TEST_SUITE_P(, CameraOptics, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE), stages_name);

TEST(Optics, host_stages_and_compute_agree) {
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  std::vector<Pixels> images;
  for (const uint32_t tracer : {KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE}) {
    World world(tracer);
    world.add(sphere(0.5, 16, false), lambert(0.7f), placed({0.1, 0, 2}));
    world.add_point({0.5, -1, 0}, 5);
    world.set_environment(0.3f);
    kuafu_view_desc view = visible(view_at({0, 0, 0}, side, side, focal_px));
    const kuafu_optics_desc optics = everything();
    view.optics = &optics;
    images.push_back(world.radiance(view));
  }
  for (size_t i = 0; i < images[0].values.size(); ++i)
    ASSERT_NEAR(images[0].values[i], images[1].values[i], 2e-4f * images[0].values[i]) << i;
}

TEST(Optics, what_cannot_be_is_refused) {
  World world;
  world.set_environment(1);
  const auto refuses = [&](auto change, const char* word) {
    kuafu_optics_desc optics = kuafu_optics_desc_init();
    change(optics);
    kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 4);
    view.optics = &optics;
    expect_refused(world.status_of(view), word);
  };
  refuses([](kuafu_optics_desc& f) { f.vignetting_exponent = -1; }, "vignetting_exponent is -1");
  refuses([](kuafu_optics_desc& f) { f.vignetting_polynomial[1] = NAN; }, "vignetting_polynomial");
  refuses([](kuafu_optics_desc& f) { f.psf_sigma_px = 33; }, "psf_sigma_px is 33");
  refuses([](kuafu_optics_desc& f) { f.psf_corner_sigma_px = INFINITY; }, "psf_corner_sigma_px");
  refuses([](kuafu_optics_desc& f) { f.defocus_lens_radius_m = 0.1, f.defocus_focus_m = 0; }, "defocus_focus_m is 0");
  refuses([](kuafu_optics_desc& f) { f.veiling_glare_fraction = 1.5; }, "veiling_glare_fraction is 1.5");
  refuses([](kuafu_optics_desc& f) { f.firefly_factor = 0.5; }, "firefly_factor is 0.5");
}

}  // namespace
}  // namespace laws
