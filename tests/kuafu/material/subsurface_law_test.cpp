// SPDX-License-Identifier: Apache-2.0
// Light that wanders below the surface: energy, the limit of a short way, how far it gets, and which layer and group it has.
#include "kuafu/world.h"

namespace laws {
namespace {

kuafu_material_desc body(float albedo, float radius_m) {
  kuafu_material_desc m = lambert(0);
  m.subsurface = 1;
  m.ir_subsurface_color = albedo;
  m.ir_subsurface_radius_m = radius_m;
  for (int i = 0; i < 3; ++i) {
    m.subsurface_color[i] = albedo;
    m.subsurface_radius_m[i] = radius_m;
  }
  return m;
}

TEST(Subsurface, a_white_body_vanishes_in_a_white_furnace) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE})
    for (const float radius : {0.02f, 0.3f})
      for (const float specular : {0.0f, 1.0f}) {
        if (tracer == KUAFU_TRACER_COMPUTE && radius + specular < 1.2f) continue;
        World world(tracer);
        kuafu_material_desc m = body(1, radius);
        m.specular = specular;
        m.roughness = 0.4f;
        world.add(sphere(0.5, 24, true), m, placed({0, 0, 2}));
        world.set_environment(1.0f);
        EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 8, 8, 20), 64).mean(), 1, 0.012) << radius << " " << specular;
      }
}

/// Mean radiance of a big block's front in even light.
double block_in_furnace(const kuafu_material_desc& m, double angle = 0, uint32_t band = KUAFU_BAND_INFRARED) {
  World world;
  world.add(box({1, 1, 1}), m, placed({0, 0, 3}, angle));
  world.set_environment(1.0f);
  kuafu_view_desc view = view_at({0, 0, 0}, 4, 4, 2000);
  view.band = band;
  return world.radiance(view, 1024).mean();
}

TEST(Subsurface, of_short_ways_has_the_albedo_that_it_was_given) {
  for (const float albedo : {0.2f, 0.5f, 0.9f}) EXPECT_NEAR(block_in_furnace(body(albedo, 3e-3f)), albedo, 0.015) << albedo;
}

TEST(Subsurface, of_short_ways_is_lambert_under_a_lamp) {
  for (const double angle : {0.0, 1.0}) {
    double means[2];
    for (const bool below : {false, true}) {
      World world;
      world.add(box({1, 1, 1}), below ? body(0.6f, 2e-3f) : lambert(0.6f), placed({0, 0, 3}));
      world.add_point({1.5 * std::sin(angle), 0, 2 - 1.5 * std::cos(angle)}, 5.0f);
      means[below] = world.radiance(view_at({0, 0, 0}, 4, 4, 4000), 2048, 0).mean();
    }
    EXPECT_NEAR(means[1] / means[0], 1, 0.03) << angle;
  }
}

/// BRDF, up to a factor, of a block with a smooth layer and short ways below it.
double below_layer(double light_angle, double view_angle) {
  World world;
  kuafu_material_desc m = body(0.8f, 1e-3f);
  m.specular = 1;
  m.roughness = 0;
  world.add(box({1, 1, 1}), m, placed({0, 0, 1}));
  world.add_point({10 * std::sin(light_angle), 0, -10 * std::cos(light_angle)}, 100.0f);
  const Vec3 eye{std::sin(view_angle), 0, -std::cos(view_angle)};
  return world.radiance(view_at(eye, 4, 4, 40000, -view_angle), 2048, 0).mean() / std::cos(light_angle);
}

// The layer takes from the light on its way in what Fresnel says, as it does on its way out.
TEST(Subsurface, is_reciprocal_below_a_layer) {
  const double there = below_layer(0.2, 1.35), back = below_layer(1.35, 0.2);
  EXPECT_GT(there, 0.05);
  EXPECT_NEAR(there / back, 1, 0.03);
}

TEST(Subsurface, channels_wander_each_on_their_own) {
  kuafu_material_desc m = body(0.5f, 1e-3f);
  const float colour[3] = {0.9f, 0.5f, 0.1f}, radius[3] = {1e-2f, 5e-3f, 2e-3f};
  std::copy(colour, colour + 3, m.subsurface_color);
  std::copy(radius, radius + 3, m.subsurface_radius_m);
  World world;
  world.add(box({1, 1, 1}), m, placed({0, 0, 3}));
  world.set_environment(1.0f);
  const Pixels image = world.radiance(visible(view_at({0, 0, 0}, 4, 4, 2000)), 2048);
  double means[3] = {};
  for (size_t i = 0; i < image.values.size(); ++i) means[i % 3] += double(image.values[i]) / 16;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(means[c], colour[c], 0.02) << c;
}

// A half share of the diffuse base: half as bright as both together.
TEST(Subsurface, mixes_with_the_diffuse_base) {
  kuafu_material_desc m = body(0.8f, 3e-3f);
  m.subsurface = 0.5f;
  m.ir_albedo = 0.4f;
  EXPECT_NEAR(block_in_furnace(m), 0.6, 0.015);
}

/// Mean distance between where the eye's ray enters a block and where its light comes in: a lamp whose pattern grows with the distance from
/// there, over one that is even. By reciprocity a thin beam spreads the same.
double mean_distance(const kuafu_material_desc& m, double reach_m) {
  constexpr uint32_t n = 257;
  World world;
  world.add(box({0.5, 0.5, 0.5}), m, placed({0, 0, 1.5}));  // its front at z = 1
  std::vector<float> ramp(n * n), even(n * n);
  for (uint32_t i = 0; i < n * n; ++i) {
    const double x = (i % n - 128.0) / 128 * reach_m, y = (i / n - 128.0) / 128 * reach_m, r = std::hypot(x, y);
    const double facing = r < reach_m ? std::pow(1 + r * r, 1.5) : 0;  // even irradiance on the block
    even[i] = float(facing);
    ramp[i] = float(facing * r);
  }
  const double focal_px = 128 / reach_m;
  const uint32_t lamp = world.add_projector(even, n, n, focal_px, 1.0f);
  world.take(8192, 0);
  const kuafu_view_desc view = view_at({0, 0, 0}, 2, 2, 1e6);
  auto images = world.render({view}, {KUAFU_OUTPUT_PROJECTOR_INDIRECT, KUAFU_OUTPUT_PROJECTOR_DIRECT});
  EXPECT_EQ(images[KUAFU_OUTPUT_PROJECTOR_DIRECT].mean(), 0) << "what wandered is indirect";
  ok(kuafu_scene_remove_light(world.scene(), lamp));
  world.add_projector(ramp, n, n, focal_px, 1.0f);
  return world.image(view, KUAFU_OUTPUT_PROJECTOR_INDIRECT).mean() / images[KUAFU_OUTPUT_PROJECTOR_INDIRECT].mean();
}

/// The same by diffusion theory: a point source at depth z and its image above the extrapolated boundary (Farrell, Patterson, Wilson 1992).
double diffusion_distance(double single_albedo, double radius_m, double z, double reach_m) {
  const double d = radius_m / 3, sigma = std::sqrt((1 - single_albedo) / radius_m / d), zb = 2 * d;  // index-matched: no inner reflection
  double weight = 0, moment = 0;
  for (int i = 0; i < 20000; ++i) {
    const double r = reach_m * (i + 0.5) / 20000;
    double exitance = 0;
    for (const double h : {z, z + 2 * zb}) {
      const double way = std::hypot(r, h);
      exitance += h * (1 + sigma * way) * std::exp(-sigma * way) / (way * way * way);
    }
    weight += exitance * r;
    moment += exitance * r * r;
  }
  return moment / weight;
}

// Light enters by the cosine law: 2/3 of a mean free path deep on average.
TEST(Subsurface, light_gets_as_far_as_diffusion_says) {
  constexpr double radius_m = 0.01, reach_m = 15 * radius_m;
  for (const double albedo : {0.7, 0.85, 0.95}) {
    // van de Hulst 1980: albedo of a half space in even light.
    const double b = 1.139 + 1.17 * albedo, s = (b - std::sqrt(b * b - 4 * 0.139 * (1 - albedo))) / (2 * 0.139);
    const double seen = mean_distance(body(float(albedo), float(radius_m)), reach_m);
    EXPECT_NEAR(seen / diffusion_distance(1 - s * s, radius_m, radius_m * 2 / 3, reach_m), 1, 0.15) << albedo;
  }
}

TEST(Subsurface, thin_things_let_light_through) {
  World world;
  world.add(box({0.5, 0.5, 0.005}), body(0.9f, 0.02f), placed({0, 0, 1}));
  world.add(quad({0, 0, 2}, {-2, 0, 0}, {0, 2, 0}), emitter(1.0f));
  EXPECT_GT(world.radiance(view_at({0, 0, 0}, 4, 4, 2000), 1024).mean(), 0.3);
}

TEST(Subsurface, bad_values_are_refused_with_the_numbers) {
  World world;
  const auto refused = [&](const kuafu_material_desc& m, const std::string& text) {
    uint32_t id = 0;
    expect_refused(kuafu_scene_add_material(world.scene(), &m, &id), text);
  };
  kuafu_material_desc m = body(0.5f, 0.01f);
  m.subsurface = 2;
  refused(m, "subsurface is 2");
  refused(body(1.5f, 0.01f), "subsurface_color is 1.5");
  refused(body(0.5f, 0), "subsurface_radius_m is 0");
}

}  // namespace
}  // namespace laws
