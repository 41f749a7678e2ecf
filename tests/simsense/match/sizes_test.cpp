// SPDX-License-Identifier: Apache-2.0
// The CPU matcher gives the scalar reference's bits at any size from 32x32 to 4096x2160 and any range from 16 to 1024 disparities. The
// reference stores whole volumes, so each case has a budget of costs (pixels times disparities): small ones here, larger ones in the full
// set (ACTIVESTEREO_FULL); the largest images are held to what does not need it.
#include <cmath>
#include <cstdlib>

#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"

namespace {

using namespace simsense_test;

bool full_set() {
  const char* full = std::getenv("ACTIVESTEREO_FULL");
  return full && *full == '1';
}

void expect_reference(const StereoPair& pair, const MatchParameters& p, unsigned threads) {
  ks::ThreadPool workers(threads);
  const auto reference = simsense::make_reference_matcher(pair.width, pair.height, p);
  const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
  expect_same(match(*reference, pair), match(*cpu, pair), pair.width, describe(pair.width, pair.height, p));
}

/// Sizes and ranges spread evenly over their logarithms; all three shrink together until the budget holds.
void fuzz_sizes(unsigned seed, int cases, double budget) {
  Fuzz fuzz(seed);
  std::mt19937 random(seed);
  const auto spread = [&](double low, double high) { return low * std::pow(high / low, std::uniform_real_distribution<double>()(random)); };
  for (int i = 0; i < cases; ++i) {
    double width = spread(32, 4096), height = spread(32, 2160), disparities = spread(16, 1024);
    while (width * height * disparities > budget) {
      width = std::max(32.0, 0.9 * width);
      height = std::max(32.0, 0.9 * height);
      disparities = std::max(16.0, 0.95 * disparities);
    }
    MatchParameters p = fuzz.all_parameters(i % 3 == 2);
    p.max_disparity = static_cast<uint32_t>(disparities);
    const auto shift = static_cast<uint32_t>(std::max(0, p.min_disparity)) + fuzz.in(0, std::min<uint32_t>(p.max_disparity - 1, 200));
    expect_reference(random_dots(static_cast<uint32_t>(width), static_cast<uint32_t>(height), shift, 15, fuzz.in(0, 1u << 30)), p,
                     fuzz.in(1, 4));
  }
}

TEST(matcher_sizes, fuzzed_sizes_and_ranges_equal_the_reference) {
  if (full_set()) {
    fuzz_sizes(31, 60, 6e7);
  } else {
    fuzz_sizes(21, 12, 2.5e6);
  }
}

TEST(matcher_sizes, longest_rows_and_columns_equal_the_reference) {
  MatchParameters p;
  p.max_disparity = 16;
  expect_reference(random_dots(4096, 32, 9, 10, 1), p, 2);
  expect_reference(random_dots(33, 2160, 7, 10, 2), p, 3);
  p.block_width = p.block_height = 5;
  expect_reference(random_dots(4095, 33, 9, 10, 3), p, 2);
}

TEST(matcher_sizes, smallest_image_takes_the_widest_range) {
  for (const uint32_t paths : {4u, 8u}) {
    MatchParameters p;
    p.path_count = paths;
    p.max_disparity = 1024;
    expect_reference(random_dots(32, 32, 5, 10, 4), p, 1);
  }
}

/// The largest image with a range that no stored volume allows here: the shift of the pair comes back, for any number of threads.
TEST(matcher_sizes, largest_image_with_512_disparities_finds_its_shift) {
  if (!full_set()) GTEST_SKIP() << "20 seconds: only with ACTIVESTEREO_FULL=1 (tests/run.sh --full)";
  constexpr uint32_t width = 4096, height = 2160, shift = 487;
  const StereoPair pair = random_dots(width, height, shift, 10, 5);
  MatchParameters p;
  p.max_disparity = 512;
  std::vector<float> first;
  for (const unsigned threads : {2u, 3u}) {
    ks::ThreadPool workers(threads);
    const std::vector<float> disparity = match(*simsense::make_cpu_matcher(width, height, p, workers), pair);
    size_t found = 0, pixels = 0;
    for (size_t y = 0; y < height; ++y)
      for (size_t x = shift; x < width; ++x, ++pixels) found += std::abs(disparity[y * width + x] - shift) < 0.5f;
    EXPECT_GT(static_cast<double>(found), 0.995 * static_cast<double>(pixels));
    if (first.empty()) first = disparity;
    expect_same(first, disparity, width, std::to_string(threads) + " threads");
  }
}

}  // namespace
