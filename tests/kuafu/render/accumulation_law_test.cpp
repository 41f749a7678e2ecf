// SPDX-License-Identifier: Apache-2.0
// Samples over several calls and rounds: sums that go on, the variance of a pixel's mean, budgets of noise and time.
#include <limits>

#include "kuafu/world.h"

namespace {

using namespace laws;

const std::vector<uint32_t> outputs = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_AMBIENT, KUAFU_OUTPUT_VARIANCE, KUAFU_OUTPUT_SAMPLE_COUNT};

/// A corner under a small bright panel and a lamp: noise in every pixel.
class Corner {
 protected:
  explicit Corner(uint32_t tracer) : world_(tracer) {
    if (world_.renderer() == nullptr) return;
    world_.add(quad({0, 0, 2}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f));
    world_.add(quad({-1, 0, 1}, {0, 0, 1}, {0, 1, 0}), lambert(0.8f));
    world_.add(quad({0.5, -0.8, 1.5}, {0.2, 0, 0}, {0, 0, 0.2}), emitter(8));
    world_.add_point({0.2, 0.2, 0.5}, 0.3f);
    world_.take(16, 2);
  }
  std::map<uint32_t, Pixels> render(uint32_t samples, bool accumulate, const std::vector<uint32_t>& which = outputs, uint32_t side = 8) {
    world_.desc().samples_per_pixel = samples;
    world_.desc().accumulate = accumulate;
    return world_.render({view_at({0, 0, 0}, side, side, side)}, which);
  }
  kuafu_render_summary summary() {
    kuafu_render_summary s = kuafu_render_summary_init();
    ok(kuafu_renderer_get_summary(world_.renderer(), &s));
    return s;
  }
  World world_;
};

class Accumulation : public Corner, public testing::TestWithParam<uint32_t> {
 protected:
  Accumulation() : Corner(GetParam()) {}
};

class AccumulationOnHost : public Corner, public testing::Test {
 protected:
  AccumulationOnHost() : Corner(KUAFU_TRACER_EMBREE) {}
};

void expect_same(const Pixels& a, const Pixels& b, double tolerance) {
  ASSERT_EQ(a.values.size(), b.values.size());
  for (size_t i = 0; i < a.values.size(); ++i) EXPECT_NEAR(a.values[i], b.values[i], tolerance * std::abs(b.values[i]) + 1e-9) << i;
}

TEST_P(Accumulation, four_calls_are_one) {
  for (const bool variance : {false, true}) {
    std::vector<uint32_t> which = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_AMBIENT, KUAFU_OUTPUT_SAMPLE_COUNT};
    if (variance) which.push_back(KUAFU_OUTPUT_VARIANCE);
    auto once = render(64, false, which);
    std::map<uint32_t, Pixels> last;
    for (uint32_t call = 1; call <= 4; ++call) {
      last = render(16, true, which);
      EXPECT_EQ(last[KUAFU_OUTPUT_SAMPLE_COUNT].id_at(0, 3, 3), 16 * call);
      EXPECT_EQ(summary().samples_per_pixel, 16 * call);
      EXPECT_EQ(summary().call_samples_per_pixel, 16u);
    }
    expect_same(last[KUAFU_OUTPUT_RADIANCE], once[KUAFU_OUTPUT_RADIANCE], 2e-6);
    expect_same(last[KUAFU_OUTPUT_AMBIENT], once[KUAFU_OUTPUT_AMBIENT], 2e-6);
    if (variance) expect_same(last[KUAFU_OUTPUT_VARIANCE], once[KUAFU_OUTPUT_VARIANCE], 1e-3);
  }
}

// They take no samples of light: neither as the first call nor between two.
TEST_P(Accumulation, calls_for_aovs_alone_leave_it_as_it_is) {
  const std::vector<uint32_t> light = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_SAMPLE_COUNT};
  auto once = render(32, false, light);
  (void)render(16, true, {KUAFU_OUTPUT_DEPTH});
  (void)render(16, true, light);
  (void)render(16, true, {KUAFU_OUTPUT_DEPTH});
  auto last = render(16, true, light);
  EXPECT_EQ(last[KUAFU_OUTPUT_SAMPLE_COUNT].id_at(0, 3, 3), 32u);
  expect_same(last[KUAFU_OUTPUT_RADIANCE], once[KUAFU_OUTPUT_RADIANCE], 2e-6);
}

TEST_P(Accumulation, begins_anew_after_a_call_without_it_and_with_other_sizes) {
  const auto count = [](std::map<uint32_t, Pixels> images) { return images[KUAFU_OUTPUT_SAMPLE_COUNT].id_at(0, 0, 0); };
  const std::vector<uint32_t> which = {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_SAMPLE_COUNT};
  EXPECT_EQ(count(render(4, false, which)), 4u);
  EXPECT_EQ(count(render(4, true, which)), 4u);
  EXPECT_EQ(count(render(4, true, which)), 8u);
  EXPECT_EQ(count(render(4, true, which, 9)), 4u);
  EXPECT_EQ(count(render(4, true, which, 9)), 8u);
  EXPECT_EQ(count(render(4, false, which, 9)), 4u);
  EXPECT_EQ(count(render(4, true, which, 9)), 4u);
  // A call that was cancelled left pixels of different counts.
  world_.desc().progress = [](void*, float) -> int32_t { return 1; };
  EXPECT_EQ(world_.status_of(view_at({0, 0, 0}, 9, 9, 9)), KS_ERROR_CANCELLED);
  world_.desc().progress = nullptr;
  EXPECT_EQ(count(render(4, true, which, 9)), 4u);
}

TEST_F(AccumulationOnHost, variance_is_the_spread_over_seeds) {
  constexpr int seeds = 1500;
  std::vector<double> sum(64), squares(64);
  double estimate = 0, spread = 0;
  for (int seed = 0; seed < seeds; ++seed) {
    world_.desc().seed = uint64_t(seed) + 1;
    auto images = render(16, false);
    for (size_t i = 0; i < 64; ++i) {
      const double value = images[KUAFU_OUTPUT_RADIANCE].values[i];
      sum[i] += value;
      squares[i] += value * value;
      estimate += images[KUAFU_OUTPUT_VARIANCE].values[i] / seeds;
    }
  }
  for (size_t i = 0; i < 64; ++i) spread += (squares[i] - sum[i] * sum[i] / seeds) / (seeds - 1);
  EXPECT_NEAR(estimate / spread, 1.0, 0.06);
}

TEST_F(AccumulationOnHost, relative_error_is_the_error) {
  const std::vector<uint32_t> which = {KUAFU_OUTPUT_RADIANCE};
  // Few pixels, whose replicates tell little of their noise, must not stop when they happen to agree.
  for (const auto& [side, target, seeds] : {std::tuple{1u, 0.05, 30u}, {2u, 0.08, 30u}, {8u, 0.12, 32u}}) {
    world_.desc().relative_error = 0;
    const Pixels exact = render(1 << 13, false, which, side)[KUAFU_OUTPUT_RADIANCE];
    world_.desc().relative_error = target;
    double error = 0, claimed = 0;
    for (uint64_t seed = 1; seed <= seeds; ++seed) {
      world_.desc().seed = seed;
      const Pixels image = render(100000, false, which, side)[KUAFU_OUTPUT_RADIANCE];
      for (size_t i = 0; i < image.values.size(); ++i)
        error += std::pow((image.values[i] - exact.values[i]) / exact.mean(), 2) / double(image.values.size()) / seeds;
      EXPECT_LE(summary().relative_error, target);
      claimed += std::pow(summary().relative_error, 2) / seeds;
    }
    EXPECT_LT(error, 1.05 * claimed) << side;
    EXPECT_GT(error, (side > 2 ? 0.4 : 0.02) * claimed) << side;  // and not far more samples than it takes
  }
}

TEST(Variance, is_the_same_wherever_it_is_rendered) {
  SKIP_IF(why_not(KUAFU_TRACER_EMBREE));
  std::map<uint32_t, Pixels> images[2];
  for (const uint32_t tracer : {KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE}) {
    World world(tracer);
    world.add(quad({0, 0, 2}, {-2, 0, 0}, {0, 2, 0}), lambert(0.5f));
    world.add(quad({0, -0.8, 1.5}, {0.2, 0, 0}, {0, 0, 0.2}), emitter(8));
    images[tracer == KUAFU_TRACER_COMPUTE] = world.render({view_at({0, 0, 0}, 8, 8, 8)}, outputs);
  }
  EXPECT_GT(images[0][KUAFU_OUTPUT_VARIANCE].mean(), 0);
  expect_same(images[1][KUAFU_OUTPUT_VARIANCE], images[0][KUAFU_OUTPUT_VARIANCE], 1e-3);
}

TEST_P(Accumulation, one_sample_has_no_variance_to_show) {
  auto one = render(1, false), nine = render(9, false);
  for (const float v : one[KUAFU_OUTPUT_VARIANCE].values) EXPECT_EQ(v, std::numeric_limits<float>::infinity());
  for (const float v : nine[KUAFU_OUTPUT_VARIANCE].values) EXPECT_TRUE(std::isfinite(v));
}

TEST_P(Accumulation, stops_at_the_relative_error) {
  const std::vector<uint32_t> which = {KUAFU_OUTPUT_RADIANCE};
  world_.desc().relative_error = 0.08;
  const Pixels image = render(100000, false, which)[KUAFU_OUTPUT_RADIANCE];
  const kuafu_render_summary first = summary();
  EXPECT_LE(first.relative_error, 0.08);
  EXPECT_GT(first.samples_per_pixel, 16u);
  EXPECT_LT(first.samples_per_pixel, 4096u);
  EXPECT_EQ(render(100000, false, which)[KUAFU_OUTPUT_RADIANCE].values, image.values);
  EXPECT_EQ(summary().samples_per_pixel, first.samples_per_pixel);
  // Without that budget the same number of samples gives the same light, rounds or not.
  world_.desc().relative_error = 0;
  expect_same(render(first.samples_per_pixel, false, outputs)[KUAFU_OUTPUT_RADIANCE], image, 2e-6);
  EXPECT_TRUE(std::isnan(summary().relative_error));
}

TEST_P(Accumulation, never_takes_more_than_samples_per_pixel) {
  world_.desc().relative_error = 1e-6;
  render(40, false, {KUAFU_OUTPUT_RADIANCE});
  EXPECT_EQ(summary().samples_per_pixel, 40u);
  EXPECT_GT(summary().relative_error, 1e-6);
}

TEST_P(Accumulation, stops_when_time_is_up) {
  world_.desc().max_seconds = 0.02;
  render(1u << 30, false, {KUAFU_OUTPUT_RADIANCE, KUAFU_OUTPUT_SAMPLE_COUNT});
  EXPECT_GE(summary().samples_per_pixel, 1u);
  EXPECT_LT(summary().samples_per_pixel, 1u << 24);
  EXPECT_GT(summary().seconds, 0);
}

INSTANTIATE_TEST_SUITE_P(Stages, Accumulation, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE), stages_name);

}  // namespace
