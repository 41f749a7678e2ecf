// SPDX-License-Identifier: Apache-2.0
// Light that glass bends on its way from a lamp or projector: where it lands and how much, against rays by Snell and Fresnel.
#include <functional>

#include "kuafu/material/measured.h"

namespace laws {
namespace {

constexpr double ior = 1.5;

/// Where a ray lands that meets a ball, and what share of it arrives.
struct Arrival {
  bool found = false;
  double x = 0, share = 0;
};

/// A ball on the axis, and the wall z = wall. The ray meets the ball at the angle `in`, goes at `angle` from +z towards +x before, and is
/// reflected so many times inside.
Arrival through_ball(double angle, double in, double centre, double radius, double wall, int reflections) {
  const double inside = std::asin(std::sin(in) / ior), r = reflectance(in, ior);
  // The point of entry has polar angle in - angle about the ball's centre, seen from the lamp's side; each chord turns it by pi - 2 inside.
  const double exit = pi - (in - angle) - (1 + reflections) * (pi - 2 * inside);
  const double direction = angle - 2 * (in - inside) - reflections * (pi - 2 * inside);
  if (std::cos(direction) <= 0.05) return {};
  const double z = centre + radius * std::cos(exit), x = radius * std::sin(exit);
  return {true, x + std::tan(direction) * (wall - z), (1 - r) * (1 - r) * std::pow(r, reflections)};
}

constexpr int most_reflections = 6;  // a ray passes eight surfaces at most

/// Mean irradiances of rings of equal width that fill a disc of the wall around the axis, for a lamp of 1 W/sr.
std::vector<double> rings_by_light_tracing(double centre, double radius, double wall, double disc, size_t count) {
  std::vector<double> rings(count, 0.0);
  const double most = std::asin(radius / centre);
  constexpr int rays = 400000;
  for (int i = 0; i < rays; ++i) {
    const double angle = most * (i + 0.5) / rays, in = std::asin(centre * std::sin(angle) / radius);
    for (int reflections = 0; reflections <= most_reflections; ++reflections) {
      const Arrival l = through_ball(angle, in, centre, radius, wall, reflections);
      const auto ring = size_t(std::abs(l.x) / disc * double(count));
      if (l.found && ring < count) rings[ring] += l.share * 2 * pi * std::sin(angle) * most / rays;
    }
  }
  for (size_t k = 0; k < count; ++k) rings[k] /= pi * disc * disc * double(2 * k + 1) / double(count * count);
  return rings;
}

/// The same rings of an image of the wall, in irradiance; the camera looks along the axis.
std::vector<double> rings_of(const Pixels& image, double disc_px, size_t count, double albedo) {
  std::vector<double> sums(count, 0.0), pixels(count, 0.0);
  const double middle = (image.width - 1) / 2.0;
  for (uint32_t r = 0; r < image.height; ++r)
    for (uint32_t c = 0; c < image.width; ++c) {
      const auto ring = size_t(std::hypot(r - middle, c - middle) / disc_px * double(count));
      if (ring >= count) continue;
      sums[ring] += image.at(0, r, c) * pi / albedo;
      pixels[ring] += 1;
    }
  for (size_t k = 0; k < count; ++k) sums[k] /= pixels[k];
  return sums;
}

TEST(BentLight, a_ball_spreads_a_lamps_light_as_traced_rays_say) {
  const double centre = 0.7, radius = 0.06, wall = 1.4, camera = 0.8;
  // Pixels on the shadow's edge show what lies beside it.
  const double shadow = 0.95 * wall * std::tan(std::asin(radius / centre)), focal_px = 600, shadow_px = shadow / (wall - camera) * focal_px;
  const std::vector<double> expected = rings_by_light_tracing(centre, radius, wall, shadow, 6);
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    World world(tracer);
    world.add(quad({0, 0, wall}, {-0.5, 0, 0}, {0, 0.5, 0}), lambert(0.5f));
    world.add(sphere(radius, 128, true), glass(float(ior)), placed({0, 0, centre}));
    world.add_point({0, 0, 0}, 1.0f);
    world.take(tracer == KUAFU_TRACER_AUTO ? 64 : 4, 0);
    world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_BENT;
    const auto side = uint32_t(2 * shadow_px) + 3;
    const std::vector<double> found =
        rings_of(world.radiance(view_at({0, 0, camera}, side, side, focal_px)), shadow_px, expected.size(), 0.5);
    double sum = 0, expected_sum = 0;
    for (size_t k = 0; k < expected.size(); ++k) {
      // What is reflected inside crosses on the axis: few beams have much of the innermost ring's light.
      EXPECT_NEAR(found[k] / expected[k], 1, k == 0 ? 0.1 : 0.03) << "ring " << k << " of tracer " << tracer;
      sum += found[k] * double(2 * k + 1);
      expected_sum += expected[k] * double(2 * k + 1);
    }
    EXPECT_NEAR(sum / expected_sum, 1, 0.01) << tracer;
  }
}

/// A projector at the origin lights the wall z = 1 through a tilted slab, behind which the camera stands.
struct BehindSlab {
  static constexpr double thickness = 0.05, tilt = 0.5, focal_px = 60;
  static constexpr uint32_t columns = 64;

  Pixels image(const std::function<float(uint32_t)>& pattern) const {
    World world;
    world.add(quad({0, 0, 1}, {-0.5, 0, 0}, {0, 0.5, 0}), lambert(0.5f));
    world.add(box({0.3, 0.3, thickness / 2}), glass(float(ior)), placed({0, 0, 0.5}, tilt));
    std::vector<float> texels(size_t(columns) * columns);
    for (size_t i = 0; i < texels.size(); ++i) texels[i] = pattern(uint32_t(i % columns));
    world.add_projector(texels, columns, columns, focal_px, 1.0f);
    world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_BENT;
    return world.radiance(view_at({0, 0, 0.75}, 41, 9, 150), 16, 0);
  }

  /// Column of the pattern whose light lands at x: the slab moves a ray aside by t sin(i) (1 - cos(i) / (n cos(t))) (Hecht, Optics, 4.4).
  static double column_at(double x) {
    double low = -0.4, high = 0.4;
    for (int step = 0; step < 60; ++step) {
      const double angle = (low + high) / 2, i = angle - tilt, t = std::asin(std::sin(i) / ior);
      const double aside = thickness * std::sin(i) * (1 - std::cos(i) / (ior * std::cos(t)));
      (std::tan(angle) - aside / std::cos(angle) < x ? low : high) = angle;
    }
    return focal_px * std::tan(low) + (columns - 1) / 2.0;
  }
};

TEST(BentLight, dots_behind_a_slab_are_displaced_as_snell_says) {
  const BehindSlab slab;
  const Pixels ramp = slab.image([](uint32_t column) { return float(column); }), flat = slab.image([](uint32_t) { return 1.0f; });
  double moved = 0;
  for (uint32_t c = 0; c < ramp.width; ++c) {
    const double x = (c - (ramp.width - 1) / 2.0) / 150 * 0.25;
    const double straight = BehindSlab::focal_px * x + (BehindSlab::columns - 1) / 2.0, expected = BehindSlab::column_at(x);
    EXPECT_NEAR(ramp.at(0, 4, c) / flat.at(0, 4, c), expected, 0.05) << x;  // light that the slab reflects twice lands elsewhere
    moved = std::max(moved, std::abs(expected - straight));
  }
  EXPECT_GT(moved, 0.3);
}

TEST(BentLight, a_pane_dims_by_fresnel_and_brings_the_lamp_nearer) {
  const double thickness = 0.02;
  World open, glazed;
  for (World* world : {&open, &glazed}) {
    world->add(quad({0, 0, 1}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
    world->add_point({0, 0, 0}, 1.0f);
    world->take(4, 0);
    world->desc().glass_shadows = KUAFU_GLASS_SHADOWS_BENT;
  }
  glazed.add(box({0.3, 0.3, thickness / 2}), glass(float(ior)), placed({0, 0, 0.4}));
  const auto mean = [](World& world) { return world.radiance(view_at({0, 0, 0.5}, 5, 5, 5000)).mean(); };
  // Near the axis the lamp seems nearer by t (1 - 1 / n).
  const double r = reflectance(0, ior), nearer = 1 - thickness * (1 - 1 / ior);
  EXPECT_NEAR(mean(glazed) / mean(open), (1 - r) * (1 - r) / (nearer * nearer), 1e-4);
}

TEST(BentLight, a_directional_light_is_focused_by_a_ball) {
  const double radius = 0.06, behind = 0.5, disc = 0.04, camera = 0.2, focal_px = 600;
  World world;
  world.add(quad({0, 0, behind}, {-0.5, 0, 0}, {0, 0.5, 0}), lambert(0.5f));
  world.add(sphere(radius, 128, true), glass(float(ior)));
  world.add_light(light_of(KUAFU_LIGHT_DIRECTIONAL, 1.0f), placed({0, 0, 0}));
  world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_BENT;
  world.desc().glass_surfaces = 2;  // no reflection inside
  constexpr int rays = 400000;
  double power = 0;
  for (int i = 0; i < rays; ++i) {
    const double aside = (i + 0.5) / rays, in = std::asin(aside);
    const Arrival l = through_ball(0, in, 0, radius, behind, 0);
    if (l.found && std::abs(l.x) < disc) power += l.share * 2 * pi * aside * radius * radius / rays;
  }
  const double disc_px = disc / (behind - camera) * focal_px;
  const auto side = uint32_t(2 * disc_px) + 3;
  const double found = rings_of(world.radiance(view_at({0, 0, camera}, side, side, focal_px), 64, 0), disc_px, 1, 0.5)[0];
  EXPECT_NEAR(found * pi * disc * disc / power, 1, 0.005);
}

TEST(BentLight, glass_that_hardly_refracts_changes_no_light_that_walls_pass_on) {
  const auto passed_on = [](bool glazed) {
    World world;
    world.add(quad({0, 0, 1}, {-0.5, 0, 0}, {0, 0.5, 0}), lambert(0.5f));
    world.add(quad({-0.5, 0, 0.5}, {0, 0, -0.5}, {0, 0.5, 0}), lambert(0.5f));
    world.add(quad({-0.5, 0, 0.5}, {0, 0, 0.5}, {0, 0.5, 0}), lambert(0.5f));  // the same wall from its other side
    if (glazed) world.add(sphere(0.15, 64, true), glass(1.0005f), placed({0, 0, 0.5}));
    world.add_point({0, 0, 0}, 1.0f);
    world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_BENT;
    double means[2];
    for (uint32_t bounces = 0; bounces < 2; ++bounces) {
      world.desc().max_bounces = bounces;
      means[bounces] = world.radiance(view_at({0, 0, 0.7}, 48, 48, 40), 32).mean();
    }
    return means[1] - means[0];
  };
  const double bare = passed_on(false);
  EXPECT_GT(bare, 0.0);
  EXPECT_NEAR(passed_on(true) / bare, 1, 0.02);
}

TEST(BentLight, an_opaque_thing_behind_the_ball_casts_its_shadow) {
  World world;
  world.add(quad({0, 0, 1}, {-0.5, 0, 0}, {0, 0.5, 0}), lambert(0.5f));
  world.add(sphere(0.06, 32, true), glass(float(ior)), placed({0, 0, 0.5}));
  world.add(quad({0, 0, 0.2}, {-0.2, 0, 0}, {0, 0.2, 0}), lambert(0.5f));
  world.add_point({0, 0, 0}, 1.0f);
  world.desc().glass_shadows = KUAFU_GLASS_SHADOWS_BENT;
  EXPECT_EQ(world.radiance(view_at({0, 0, 0.6}, 9, 9, 100), 4, 0).mean(), 0.0);
}

}  // namespace
}  // namespace laws
