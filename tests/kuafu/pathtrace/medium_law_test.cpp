// SPDX-License-Identifier: Apache-2.0
// The participating medium: Beer and Lambert, airlight in closed form, energy, and where it is not: inside of bodies and outside its box.
#include "kuafu/world.h"

namespace laws {
namespace {

kuafu_medium_desc fog(float extinction_per_m, float albedo, double half_size_m = INFINITY) {
  kuafu_medium_desc m = kuafu_medium_desc_init();
  m.ir_extinction_per_m = extinction_per_m;
  m.ir_albedo = albedo;
  for (int i = 0; i < 3; ++i) {
    m.extinction_per_m[i] = extinction_per_m;
    m.albedo[i] = albedo;
    m.bounds_min_m[i] = -half_size_m;
    m.bounds_max_m[i] = half_size_m;
  }
  return m;
}

void set_medium(World& world, const kuafu_medium_desc& medium) { ok(kuafu_scene_set_medium(world.scene(), &medium)); }

TEST(Medium, dims_what_is_seen_through_it) {
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE})
    for (const float extinction : {0.1f, 1.5f}) {
      if (tracer == KUAFU_TRACER_COMPUTE && extinction < 1) continue;
      World world(tracer);
      world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
      set_medium(world, fog(extinction, 0));
      world.desc().samples_per_pixel = 1;
      EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 4000)).mean(), std::exp(-2 * extinction), 1e-5);
      set_medium(world, fog(extinction, 0, 0.5));  // its box ends half a metre before the eye
      EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 4000)).mean(), std::exp(-0.5 * extinction), 1e-5);
      ok(kuafu_scene_set_medium(world.scene(), nullptr));
      EXPECT_EQ(world.radiance(view_at({0, 0, 0}, 2, 2, 4000)).mean(), 1.0);
    }
}

TEST(Medium, channels_are_dimmed_each_by_its_own) {
  World world;
  world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
  kuafu_medium_desc m = fog(0, 0);
  const float extinctions[3] = {0.1f, 0.4f, 0.9f};
  std::copy(extinctions, extinctions + 3, m.extinction_per_m);
  m.ir_extinction_per_m = NAN;  // as red
  set_medium(world, m);
  kuafu_view_desc view = view_at({0, 0, 0}, 2, 2, 4000);
  EXPECT_NEAR(world.radiance(view).mean(), std::exp(-0.2), 1e-5);
  view.band = KUAFU_BAND_VISIBLE;
  const Pixels image = world.radiance(view);
  for (uint32_t c = 0; c < 3; ++c) EXPECT_NEAR(image.at(0, 0, 0, c), std::exp(-2 * double(extinctions[c])), 1e-5);
}

// Projector light that only got dimmed stays direct, and as exact as without fog; the rest is indirect.
TEST(Medium, dims_the_projector_on_both_ways_and_scatters_into_its_indirect_light) {
  const double distance = 1.5, baseline = 0.4;
  for (const float albedo : {0.0f, 0.9f}) {
    World world;
    world.add(quad({0, 0, distance}, {-2, 0, 0}, {0, 2, 0}), lambert(0.5f));
    world.add_projector(std::vector<float>(81, 1.0f), 9, 9, 4, 3.0f, placed({baseline, 0, 0}));
    world.take(1, 0);
    const kuafu_view_desc view = view_at({0, 0, 0}, 3, 3, 4000);
    const std::vector<uint32_t> groups{KUAFU_OUTPUT_PROJECTOR_DIRECT, KUAFU_OUTPUT_PROJECTOR_INDIRECT};
    const double clear = world.render({view}, groups)[KUAFU_OUTPUT_PROJECTOR_DIRECT].at(0, 1, 1);
    set_medium(world, fog(0.8f, albedo));
    auto images = world.render({view}, groups);
    EXPECT_NEAR(images[KUAFU_OUTPUT_PROJECTOR_DIRECT].at(0, 1, 1) / clear, std::exp(-0.8 * (distance + std::hypot(distance, baseline))),
                2e-4);
    if (albedo == 0) {
      EXPECT_EQ(images[KUAFU_OUTPUT_PROJECTOR_INDIRECT].mean(), 0);
    } else {
      EXPECT_GT(images[KUAFU_OUTPUT_PROJECTOR_INDIRECT].mean(), 0);
    }
  }
}

// A point light beside the way of sight in endless fog, no surface: L = integral of scattering e^(-s (t + r)) p I / r^2 dt.
TEST(Medium, single_scattering_is_its_integral) {
  const double s = 0.7, albedo = 0.6;
  for (const double g : {-0.4, 0.0, 0.7}) {
    World world;
    world.add_point({0.5, 0, 1}, 2.0f);
    kuafu_medium_desc m = fog(float(s), float(albedo));
    m.phase_g = float(g);
    set_medium(world, m);
    double expected = 0;
    const int n = 20000;
    for (int i = 0; i < n; ++i) {
      const double t = 20 * (i + 0.5) / n, z = t - 1, r = std::hypot(0.5, z);
      const double cosine = -z / r;  // of the eye's ray to the way towards the lamp
      const double p = (1 - g * g) / (4 * pi * std::pow(1 + g * g - 2 * g * cosine, 1.5));
      expected += s * albedo * std::exp(-s * (t + r)) * p * 2.0 / (r * r) * 20 / n;
    }
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 20000), 4096, 0).mean(), expected, 0.015 * expected) << g;
  }
}

// A camera's housing keeps the medium out: what is seen is dimmed from there on, and the glow of a lamp beside the camera begins there.
TEST(Medium, begins_at_the_end_of_a_cameras_housing) {
  const double s = 0.8, housing = 0.3, distance = 2.0, aside = 0.05;
  for (const uint32_t tracer : {KUAFU_TRACER_AUTO, KUAFU_TRACER_COMPUTE}) {
    World dimmed(tracer);
    dimmed.add(quad({0, 0, distance}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
    kuafu_medium_desc m = fog(float(s), 0);
    m.housing_m = float(housing);
    set_medium(dimmed, m);
    EXPECT_NEAR(dimmed.radiance(view_at({0, 0, 0}, 2, 2, 4000), 1).mean(), std::exp(-s * (distance - housing)), 1e-5);
  }
  World glow;
  glow.add_point({aside, 0, 0}, 2.0f);
  kuafu_medium_desc m = fog(float(s), 1);
  m.housing_m = float(housing);
  set_medium(glow, m);
  double expected = 0;
  const int n = 20000;
  for (int i = 0; i < n; ++i) {
    const double t = housing + 20 * (i + 0.5) / n, r = std::hypot(aside, t);
    expected += s * std::exp(-s * (t - housing + r)) / (4 * pi) * 2.0 / (r * r) * 20 / n;
  }
  EXPECT_NEAR(glow.radiance(view_at({0, 0, 0}, 2, 2, 20000), 4096, 0).mean(), expected, 0.015 * expected);
}

TEST(Medium, that_loses_nothing_vanishes_in_a_white_furnace) {
  for (const float g : {0.0f, 0.8f}) {
    World world;
    world.set_environment(1.0f);
    world.add(sphere(0.3, 16, false), lambert(1.0f), placed({0, 0, 1.5}));
    kuafu_medium_desc m = fog(1.0f, 1.0f, 2.0);
    m.phase_g = g;
    set_medium(world, m);
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 16, 16, 20), 64, 64).mean(), 1, 0.01) << g;
  }
}

// Koschmieder 1924: in even light of radiance L_a a black thing at distance d looks like L_a (1 - e^(-s d)).
TEST(Medium, airlight_of_even_light_is_koschmieders) {
  for (const double distance : {0.5, 2.0}) {
    World world;
    world.set_environment(1.0f);
    world.add(quad({0, 0, distance}, {-0.01, 0, 0}, {0, 0.01, 0}), lambert(0.0f));
    set_medium(world, fog(0.6f, 1.0f, 4.0));
    EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 3, 3, 4000), 1024, 48).mean(), 1 - std::exp(-0.6 * distance), 0.015) << distance;
  }
}

TEST(Medium, keeps_out_of_bodies) {
  kuafu_material_desc hollow = glass(1.0f);  // neither reflects nor bends
  World world;
  world.add(box({0.5, 0.5, 0.25}), hollow, placed({0, 0, 1}));
  world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
  set_medium(world, fog(1.2f, 0));
  EXPECT_NEAR(world.radiance(view_at({0, 0, 0}, 2, 2, 4000), 4).mean(), std::exp(-1.2 * 1.5), 1e-4);

  World lit;  // shadow rays through it, too
  lit.add(quad({0, 0, 1}, {-0.1, 0, 0}, {0, 0.1, 0}), lambert(1.0f));
  lit.add_point({3, 0, 1 - 3}, 1.0f);
  lit.take(1, 0);
  const kuafu_view_desc view = view_at({0, 0, 0}, 3, 3, 4000);
  const double open = lit.radiance(view).at(0, 1, 1);
  lit.add(box({0.1, 1, 1}), hollow, placed({1.5, 0, -0.5}));
  set_medium(lit, fog(0.5f, 0));
  EXPECT_NEAR(lit.radiance(view).at(0, 1, 1) / open, std::exp(-0.5 * (1 + std::sqrt(18.0) - 0.2 * std::sqrt(2.0))), 1e-3);
}

TEST(Medium, light_samples_and_phase_samples_agree) {
  const auto mean = [](uint32_t sampling) {
    World world;
    world.add_light(rectangle_light(4, 0.8, 0.8), placed({0.6, 0, 1}, -pi / 2));  // shines towards -x
    world.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f));
    kuafu_medium_desc m = fog(0.7f, 0.9f);
    m.phase_g = 0.5f;
    set_medium(world, m);
    world.desc().light_sampling = sampling;
    return world.radiance(view_at({0, 0, 0}, 8, 8, 16), 4096, 3).mean();
  };
  expect_samplings_agree(mean, 0.02, 0.05);  // close to the lamp its samples alone are noisy
}

TEST(Medium, bad_ones_are_refused_with_the_numbers) {
  World world;
  const auto refused = [&](const kuafu_medium_desc& m, const std::string& text) {
    expect_refused(kuafu_scene_set_medium(world.scene(), &m), text);
  };
  kuafu_medium_desc m = fog(-1, 0);
  refused(m, "extinction_per_m is -1");
  refused(fog(1, 1.5f), "albedo is 1.5");
  m = fog(1, 0.5f);
  m.phase_g = 1;
  refused(m, "phase_g is 1");
  m = fog(1, 0.5f);
  m.bounds_min_m[1] = m.bounds_max_m[1] = 2;
  refused(m, "bounds");
}

}  // namespace
}  // namespace laws
