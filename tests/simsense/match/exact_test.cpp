// SPDX-License-Identifier: Apache-2.0
// The CPU matcher gives the bits of the scalar reference: over fuzzed parameters and sizes, thread counts, and every instruction set of
// this machine.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"

namespace {

using namespace simsense_test;
using simsense::MatchParameters;

void compare(const StereoPair& pair, const MatchParameters& p, unsigned threads) {
  ks::ThreadPool workers(threads);
  const auto reference = simsense::make_reference_matcher(pair.width, pair.height, p);
  const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
  const auto expected = match(*reference, pair);
  const std::string what = describe(pair.width, pair.height, p) + " threads " + std::to_string(threads);
  expect_same(expected, match(*cpu, pair), pair.width, what);
  expect_same(expected, match(*cpu, pair), pair.width, what + ", second call");
}

Match matched_by_the_reference(const StereoPair& pair, const MatchParameters& p, bool wide) {
  return match_all(*simsense::make_reference_matcher(pair.width, pair.height, p), pair, wide);
}

/// Disparity, confidence and reason; on wide images too if asked.
void compare_all(const Match& expected, const StereoPair& pair, const MatchParameters& p, unsigned threads, bool wide) {
  ks::ThreadPool workers(threads);
  const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
  const Match actual = match_all(*cpu, pair, wide);
  const std::string what = describe(pair.width, pair.height, p) + " threads " + std::to_string(threads) + (wide ? " wide" : "");
  expect_same(expected.disparity, actual.disparity, pair.width, what + ": disparity");
  expect_same(expected.confidence, actual.confidence, pair.width, what + ": confidence");
  expect_same(expected.reason, actual.reason, pair.width, what + ": reason");
  expect_same(expected.disparity, match(*cpu, pair), pair.width, what + ": disparity alone");
}

void compare_all(const StereoPair& pair, const MatchParameters& p, unsigned threads, bool wide) {
  compare_all(matched_by_the_reference(pair, p, wide), pair, p, threads, wide);
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
    for (int i = 0; i < (block ? 40 : 60); ++i) compare_all(fuzz.pair(), fuzz.all_parameters(block), fuzz.in(1, 4), false);
  }
}

TEST(matcher, fuzzed_16_bit_images_equal_the_reference) {
  Fuzz fuzz(13);
  for (int i = 0; i < 20; ++i) {
    MatchParameters p = fuzz.all_parameters(i % 3 == 0);
    p.p2_full_gradient_dn *= 257;
    const StereoPair pair = fuzz.pair();
    ks::ThreadPool workers(2);
    const auto reference = simsense::make_reference_matcher(pair.width, pair.height, p);
    const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
    expect_same(match_all(*reference, pair, true).disparity, match_all(*cpu, pair, true).disparity, pair.width,
                describe(pair.width, pair.height, p));
  }
}

TEST(matcher, winners_at_the_last_disparity_equal_the_reference) {
  for (const uint32_t shift : {30u, 31u, 32u}) {
    for (const uint32_t block : {1u, 5u}) {
      MatchParameters p;
      p.max_disparity = 32;
      p.block_width = p.block_height = block;
      compare(random_dots(120, 40, shift, 60, shift), p, 1);
    }
  }
}

TEST(matcher, equals_the_reference_at_its_limits) {
  MatchParameters bytes;  // of the engine of bytes
  bytes.p1 = 126, bytes.p2 = 127;
  bytes.max_disparity = 256;
  bytes.census_width = 65, bytes.census_height = 1;
  compare(random_dots(97, 65, 12, 40, 3), bytes, 2);
  MatchParameters sums;
  sums.p2 = 223;
  sums.block_width = 15, sums.block_height = 17;
  sums.census_width = 65, sums.census_height = 1;
  sums.max_disparity = 40;
  compare(random_dots(64, 48, 6, 60, 4), sums, 2);
  MatchParameters disparities;
  disparities.max_disparity = 1024;
  compare(random_dots(64, 32, 9, 10, 5), disparities, 1);
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
      compare_all(expected, pair, p, 2, false);
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
  MatchParameters p;
  p.max_disparity = 32;
  ks::ThreadPool workers(1);
  const auto cpu = simsense::make_cpu_matcher(90, 40, p, workers);
  std::vector<float> strided(90 * 40);
  cpu->match({left.data(), stride}, {right.data(), stride}, strided.data());
  expect_same(match(*cpu, pair), strided, 90, "strided input");
}

}  // namespace
