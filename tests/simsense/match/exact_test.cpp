// SPDX-License-Identifier: Apache-2.0
// The matcher against the reference, whatever its parameters, images and sizes.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <cstdlib>

#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"

namespace {

using namespace simsense_test;
using simsense::MatchParameters;

Match matched_by_the_reference(const StereoPair& pair, const MatchParameters& p, bool wide) {
  return match_all(*simsense::make_reference_matcher(pair.width, pair.height, p), pair, wide);
}

/// Disparity, confidence and reason; on wide images if asked.
void compare(const Match& expected, const StereoPair& pair, const MatchParameters& p, unsigned threads, bool wide = false) {
  ks::ThreadPool workers(threads);
  const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
  const std::string what = describe(pair.width, pair.height, p) + " threads " + std::to_string(threads) + (wide ? " wide" : "");
  expect_same(expected, match_all(*cpu, pair, wide), pair.width, what);
  if (!wide) expect_same(expected.disparity, match(*cpu, pair), pair.width, what + ": disparity alone");
}

void compare(const StereoPair& pair, const MatchParameters& p, unsigned threads, bool wide = false) {
  compare(matched_by_the_reference(pair, p, wide), pair, p, threads, wide);
}

TEST(matcher, fuzzed_parameters_equal_the_reference) {
  for (const bool block : {false, true}) {
    Fuzz fuzz(block ? 2 : 1);
    for (int i = 0; i < (block ? 25 : 40); ++i) compare(fuzz.pair(), fuzz.parameters(block), fuzz.in(1, 4));
  }
}

TEST(matcher, fuzzed_extensions_equal_the_reference) {
  for (const bool block : {false, true}) {
    Fuzz fuzz(block ? 12 : 11);
    for (int i = 0; i < (block ? 40 : 60); ++i) compare(fuzz.pair(), fuzz.all_parameters(block), fuzz.in(1, 4));
  }
}

TEST(matcher, fuzzed_16_bit_images_equal_the_reference) {
  Fuzz fuzz(13);
  for (int i = 0; i < 20; ++i) {
    MatchParameters p = fuzz.all_parameters(i % 3 == 0);
    p.p2_full_gradient_dn *= 257;
    compare(fuzz.pair(), p, 2, true);
  }
}

TEST(matcher, winners_at_the_last_disparity_equal_the_reference) {
  for (const uint32_t shift : {30u, 31u, 32u}) {
    for (const uint32_t block : {1u, 5u}) {
      compare(random_dots(120, 40, shift, 60, shift), searching(32, block), 1);
    }
  }
}

TEST(matcher, equals_the_reference_at_its_limits) {
  MatchParameters bytes;  // of the engine of bytes
  bytes.p1 = 126, bytes.p2 = 127;
  bytes.max_disparity = 256;
  bytes.census_width = 65, bytes.census_height = 1;
  compare(random_dots(97, 65, 12, 40, 3), bytes, 2);
  compare(random_dots(64, 48, 6, 60, 4), widest_sums(), 2);
}

TEST(matcher, a_pair_of_the_sensors_width_equals_the_reference) {
  const StereoPair pair = random_dots(960, 200, 37, 10, 6);
  compare(pair, MatchParameters{}, 2);
}

TEST(matcher, every_instruction_set_of_this_machine_equals_the_reference) {
  const auto targets = hwy::SupportedAndGeneratedTargets();
  ASSERT_FALSE(targets.empty());
  Fuzz fuzz(7);
  for (const bool block : {false, true}) {
    const StereoPair pair = fuzz.pair();
    const MatchParameters p = fuzz.all_parameters(block);
    const Match expected = matched_by_the_reference(pair, p, false);
    for (const int64_t target : targets) {
      SCOPED_TRACE(hwy::TargetName(target));
      hwy::SetSupportedTargetsForTest(target);
      compare(expected, pair, p, 2);
      hwy::SetSupportedTargetsForTest(0);
    }
  }
}

TEST(matcher, row_stride_of_the_input_is_honoured) {
  const StereoPair pair = random_dots(90, 40, 8, 5, 8);
  const ptrdiff_t stride = 131;
  std::vector<uint8_t> left(stride * 40, 255), right(stride * 40, 255);
  for (size_t y = 0; y < 40; ++y) {
    std::copy_n(&pair.left[y * 90], 90, &left[y * stride]);
    std::copy_n(&pair.right[y * 90], 90, &right[y * stride]);
  }
  ks::ThreadPool workers(1);
  const auto cpu = simsense::make_cpu_matcher(90, 40, searching(32), workers);
  std::vector<float> strided(90 * 40);
  cpu->match({left.data(), stride}, {right.data(), stride}, strided.data());
  expect_same(match(*cpu, pair), strided, 90, "strided input");
}

bool full_set() {
  const char* full = std::getenv("ACTIVESTEREO_FULL");
  return full && *full == '1';
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
    compare(random_dots(static_cast<uint32_t>(width), static_cast<uint32_t>(height), shift, 15, fuzz.in(0, 1u << 30)), p, fuzz.in(1, 4));
  }
}

TEST(matcher_sizes, fuzzed_sizes_and_ranges_equal_the_reference) { full_set() ? fuzz_sizes(31, 60, 6e7) : fuzz_sizes(21, 12, 2.5e6); }

TEST(matcher_sizes, longest_rows_and_columns_equal_the_reference) {
  MatchParameters p = searching(16);
  compare(random_dots(4096, 32, 9, 10, 1), p, 2);
  compare(random_dots(33, 2160, 7, 10, 2), p, 3);
  p.block_width = p.block_height = 5;
  compare(random_dots(4095, 33, 9, 10, 3), p, 2);
}

TEST(matcher_sizes, smallest_image_takes_the_widest_range) {
  for (const uint32_t paths : {4u, 8u}) {
    MatchParameters p = searching(1024);
    p.path_count = paths;
    compare(random_dots(32, 32, 5, 10, 4), p, 1);
  }
}

/// The largest image with a range that no stored volume allows here: the shift of the pair comes back, for any number of threads.
TEST(matcher_sizes, largest_image_with_512_disparities_finds_its_shift) {
  if (!full_set()) GTEST_SKIP() << "20 seconds: only with ACTIVESTEREO_FULL=1 (tests/run.sh --full)";
  constexpr uint32_t width = 4096, height = 2160, shift = 487;
  const StereoPair pair = random_dots(width, height, shift, 10, 5);
  std::vector<float> first;
  for (const unsigned threads : {2u, 3u}) {
    ks::ThreadPool workers(threads);
    const std::vector<float> disparity = match(*simsense::make_cpu_matcher(width, height, searching(512), workers), pair);
    size_t found = 0, pixels = 0;
    for (size_t y = 0; y < height; ++y)
      for (size_t x = shift; x < width; ++x, ++pixels) found += std::abs(disparity[y * width + x] - shift) < 0.5f;
    EXPECT_GT(static_cast<double>(found), 0.995 * static_cast<double>(pixels));
    if (first.empty()) first = disparity;
    expect_same(first, disparity, width, std::to_string(threads) + " threads");
  }
}

}  // namespace
