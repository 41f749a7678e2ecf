// SPDX-License-Identifier: Apache-2.0
// The estimator is unbiased: the mean over many seeds at few samples is that of one seed at many, within its standard error.
#include "kuafu/world.h"

namespace laws {
namespace {

TEST(Estimator, many_seeds_at_four_samples_have_the_mean_of_many_samples) {
  World world;
  world.add(quad({0, 0.3, 1}, {-1, 0, 0}, {0, 0, -1}), lambert(0.7f));
  kuafu_material_desc metal = kuafu_material_desc_init();
  metal.metallic = 1;
  metal.roughness = 0.4f;
  world.add(sphere(0.12, 12, true), metal, placed({-0.2, 0.18, 1}));
  kuafu_material_desc frosted = glass(1.5f);
  frosted.transmission_roughness = 0.4f;
  world.add(sphere(0.12, 12, true), frosted, placed({0.2, 0.18, 1}));
  world.add(box({0.1, 0.02, 0.1}), emitter(3.0f), placed({0, -0.3, 1}));
  world.set_environment(0.1f);
  const kuafu_view_desc view = view_at({0, 0, 0}, 24, 24, 30);
  world.desc().samples_per_pixel = 4096;
  world.desc().seed = 12345;
  const double expected = world.radiance(view).mean();
  world.desc().samples_per_pixel = 4;
  constexpr int seeds = 256;
  double sum = 0, squares = 0;
  for (int i = 0; i < seeds; ++i) {
    world.desc().seed = uint64_t(i);
    const double mean = world.radiance(view).mean();
    sum += mean, squares += mean * mean;
  }
  const double mean = sum / seeds, error = std::sqrt((squares / seeds - mean * mean) / (seeds - 1));
  // The reference has 4 times as many samples as all seeds together: a quarter of their variance is added.
  EXPECT_NEAR(mean, expected, 4 * error * std::sqrt(1.25));
}

}  // namespace
}  // namespace laws
