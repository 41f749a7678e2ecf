// SPDX-License-Identifier: Apache-2.0
// Samples: the same bits whatever the threads and the batch, other bits for other seeds, and a sequence that goes on.
#include <cmath>

#include "kuafu/world.h"

namespace laws {
namespace {

void furnish(World& world) {
  world.add(quad({0, 0, 1.2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.6f));
  world.add(quad({0, 0.3, 0.8}, {-1, 0, 0}, {0, 0, -0.5}), lambert(0.7f));
  kuafu_material_desc metal = kuafu_material_desc_init();
  metal.metallic = 1;
  metal.roughness = 0.4f;
  world.add(sphere(0.15, 16, true, {-0.2, 0.1, 0.8}), metal);
  world.add(sphere(0.15, 16, true, {0.2, 0.1, 0.7}), glass(1.5f));
  std::vector<float> pattern(64 * 64);
  for (size_t i = 0; i < pattern.size(); ++i) pattern[i] = i % 7 == 0 ? 1.0f : 0.0f;
  world.add_projector(pattern, 64, 64, 50, 1.0f, placed({0.05, 0, 0}));
  world.set_environment(0.1f);
}

const kuafu_view_desc left = view_at({0, 0, 0}, 67, 41, 60), right = view_at({0.05, 0, 0}, 67, 41, 60);

TEST(Sampling, same_bits_for_any_number_of_workers) {
  std::vector<float> images[2];
  for (const uint32_t workers : {1u, 2u}) {
    World world(KUAFU_TRACER_AUTO, workers);
    furnish(world);
    images[workers - 1] = world.radiance(left).values;
  }
  EXPECT_EQ(images[0], images[1]);
}

// A CPU device computes BSDFs in lanes, unless some surface has one that lanes do not know, as one of rough diffuse that nobody sees here.
TEST(Sampling, a_surface_that_no_ray_meets_changes_nothing) {
  for (const bool lights_with_an_extent : {false, true}) {
    std::vector<float> images[2];
    for (const bool with_another : {false, true}) {
      World world;
      furnish(world);
      if (lights_with_an_extent) {
        kuafu_light_desc lamp = kuafu_light_desc_init(KUAFU_LIGHT_RECTANGLE);
        lamp.ir_intensity = 2;
        lamp.size_m[0] = lamp.size_m[1] = 0.3;
        world.add_light(lamp, placed({-0.3, -0.6, 0.4}));
        kuafu_light_desc bulb = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
        bulb.ir_intensity = 1;
        bulb.radius_m = 0.1;
        world.add_light(bulb, placed({0.4, -0.5, 0.5}));
      }
      kuafu_material_desc rough = lambert(0.5f);
      rough.diffuse_roughness = 0.5f;
      if (with_another) world.add(sphere(0.1, 8, true, {0, 0, -500}), rough);
      images[with_another ? 1 : 0] = world.radiance(left).values;
    }
    // Lanes have a sine of their own, which sends a ray to the other side of an edge once in a while.
    int off = 0;
    for (size_t i = 0; i < images[0].size(); ++i) off += std::abs(images[0][i] - images[1][i]) > 1e-3f * (0.01f + images[0][i]) ? 1 : 0;
    EXPECT_LE(off, int(images[0].size() / 500)) << lights_with_an_extent;
  }
}

TEST(Sampling, views_together_give_the_bits_of_each_alone) {
  World world;
  furnish(world);
  const Pixels together = world.render({left, right}, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  const Pixels a = world.radiance(left), b = world.radiance(right);
  std::vector<float> alone = a.values;
  alone.insert(alone.end(), b.values.begin(), b.values.end());
  EXPECT_EQ(together.values, alone);
}

TEST(Sampling, seeds_differ_and_agree_in_the_mean) {
  World world;
  furnish(world);
  world.desc().samples_per_pixel = 64;
  const Pixels a = world.radiance(left), same = world.radiance(left);
  world.desc().seed = 1;
  const Pixels b = world.radiance(left);
  EXPECT_EQ(a.values, same.values);
  EXPECT_NE(a.values, b.values);
  EXPECT_NEAR(a.mean(), b.mean(), 0.01 * a.mean());
}

TEST(Sampling, cameras_draw_different_noise) {
  // Both cameras see a plane lit by interreflection alone; equal noise would make the images equal up to parallax.
  World world;
  world.add(box({50, 50, 50}), emitter(1.0f));
  world.add(quad({0, 0, 2}, {-20, 0, 0}, {0, 20, 0}), lambert(0.5f));
  kuafu_material_desc spot = emitter(5.0f);
  world.add(quad({0, 0, -1}, {0.5, 0, 0}, {0, 0.5, 0}), spot);
  world.desc().samples_per_pixel = 4;
  const Pixels pair = world.render({left, right}, {KUAFU_OUTPUT_RADIANCE})[KUAFU_OUTPUT_RADIANCE];
  double mean = pair.mean(), covariance = 0, variance = 0;
  const size_t n = pair.values.size() / 2;
  for (size_t i = 0; i < n; ++i) {
    covariance += (pair.values[i] - mean) * (pair.values[n + i] - mean);
    variance += (pair.values[i] - mean) * (pair.values[i] - mean);
  }
  EXPECT_GT(variance, 0);
  EXPECT_LT(std::abs(covariance / variance), 0.1);
}

TEST(Sampling, first_sample_continues_the_sequence) {
  World world;
  furnish(world);
  world.desc().samples_per_pixel = 16;
  const Pixels all = world.radiance(left);
  world.desc().samples_per_pixel = 8;
  const Pixels first = world.radiance(left);
  world.desc().first_sample = 8;
  const Pixels second = world.radiance(left);
  for (size_t i = 0; i < all.values.size(); ++i)
    ASSERT_NEAR(all.values[i], (first.values[i] + second.values[i]) / 2, 1e-5f * (1 + all.values[i])) << i;
}

// Many samples take several passes over each pixel (256 at a time); the sums must join.
TEST(Sampling, passes_join) {
  World world;
  furnish(world);
  const kuafu_view_desc view = view_at({0, 0, 0}, 16, 10, 15);
  world.desc().samples_per_pixel = 600;
  const double all = world.radiance(view).mean();
  world.desc().samples_per_pixel = 256;
  EXPECT_NEAR(all, world.radiance(view).mean(), 0.01 * all);
}

TEST(Sampling, pixels_integrate_a_box) {
  // An edge through a pixel: its value is the covered share, and the neighbours know nothing of it.
  for (const double share : {0.1, 0.5, 0.8}) {
    World world;
    const double edge_x = (share - 0.5) / 100;  // metres right of the axis at z = 1: a pixel is 10 mm
    world.add(quad({edge_x - 1, 0, 1}, {-1, 0, 0}, {0, 1, 0}), emitter(1.0f));
    world.desc().samples_per_pixel = 256;
    const Pixels image = world.radiance(view_at({0, 0, 0}, 3, 3, 100));
    EXPECT_NEAR(image.at(0, 1, 1), share, 0.005);
    EXPECT_EQ(image.at(0, 1, 0), 1.0f);
    EXPECT_EQ(image.at(0, 1, 2), 0.0f);
  }
}

TEST(Sampling, stratified_edges_beat_independent_samples) {
  // 64 independent samples leave sqrt(p (1 - p) / 64) = 0.06 on an edge; the scrambled sequence must be far below.
  World world;
  world.add(quad({-1, 0, 1}, {-1, 0, 0}, {0.3, 1, 0}), emitter(1.0f));
  world.desc().samples_per_pixel = 64;
  const Pixels image = world.radiance(view_at({0, 0, 0}, 9, 65, 100));
  world.desc().samples_per_pixel = 4096;
  const Pixels reference = world.radiance(view_at({0, 0, 0}, 9, 65, 100));
  double squares = 0;
  int count = 0;
  for (size_t i = 0; i < image.values.size(); ++i) {
    if (reference.values[i] < 0.05f || reference.values[i] > 0.95f) continue;
    squares += std::pow(image.values[i] - reference.values[i], 2);
    ++count;
  }
  ASSERT_GT(count, 20);
  EXPECT_LT(std::sqrt(squares / count), 0.02);
}

TEST(Sampling, tracers_agree) {
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  std::vector<float> images[2];
  for (const uint32_t tracer : {KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE}) {
    World world(tracer);
    furnish(world);
    images[tracer - KUAFU_TRACER_EMBREE] = world.radiance(left).values;
  }
  size_t different = 0;
  for (size_t i = 0; i < images[0].size(); ++i) different += std::abs(images[0][i] - images[1][i]) > 0.02f * (0.05f + images[0][i]);
  EXPECT_LT(double(different), 0.01 * double(images[0].size()));
}

}  // namespace
}  // namespace laws
