// SPDX-License-Identifier: Apache-2.0
// What extends the published matcher, and how a match tells and stops its progress.
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>
#include <thread>

#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"
#include "simsense/match/stereo_pair.h"

namespace {

using namespace simsense;
using namespace simsense_test;

Match match_on_cpu(const StereoPair& pair, const MatchParameters& p, bool wide = false) {
  ks::ThreadPool workers(2);
  return match_all(*make_cpu_matcher(pair.width, pair.height, p, workers), pair, wide);
}

size_t count(const std::vector<MatchReason>& reasons, MatchReason wanted) {
  return static_cast<size_t>(std::count(reasons.begin(), reasons.end(), wanted));
}

TEST(min_disparity, moves_the_searched_range) {
  MatchParameters p = searching(32);
  p.p1 = 7;
  p.p2 = 86;  // strong enough that the paths carry a unique match to the left border
  p.subpixel = Subpixel::none;
  for (const int shift : {40, 60}) {
    const StereoPair pair = random_dots(200, 60, static_cast<uint32_t>(shift), 3, 9);
    p.min_disparity = 35;
    const Match m = match_on_cpu(pair, p);
    for (uint32_t y = 4; y < 56; ++y)
      for (uint32_t x = 80; x < 190; ++x) ASSERT_EQ(m.disparity[y * 200 + x], static_cast<float>(shift));
    EXPECT_EQ(m.disparity[30 * 200 + 3], -1.0f) << "its match lies outside the right image";
    EXPECT_EQ(m.reason[30 * 200 + 3], MatchReason::outside);
  }
}

TEST(min_disparity, may_be_negative_and_then_invalid_lies_below_it) {
  StereoPair pair = random_dots(160, 60, 6, 3, 10);
  std::swap(pair.left, pair.right);
  MatchParameters p = searching(16);
  p.min_disparity = -12;
  p.subpixel = Subpixel::none;
  const Match m = match_on_cpu(pair, p);
  EXPECT_EQ(p.invalid_disparity(), -13.0f);
  for (uint32_t y = 4; y < 56; ++y)
    for (uint32_t x = 8; x < 140; ++x) ASSERT_EQ(m.disparity[y * 160 + x], -6.0f);
  EXPECT_GT(count(m.reason, MatchReason::outside), 0u);
}

TEST(eight_paths, keep_more_of_a_noisy_pair_than_four) {
  const StereoPair pair = random_dots(200, 120, 9, 70, 11);
  MatchParameters p = searching(64);
  p.subpixel = Subpixel::none;
  const auto right_ones = [&] {
    const Match m = match_on_cpu(pair, p);
    return std::count(m.disparity.begin(), m.disparity.end(), 9.0f);
  };
  const auto four = right_ones();
  p.path_count = 8;
  EXPECT_GT(right_ones(), four);
}

TEST(adaptive_p2, places_an_edge_where_the_image_has_it) {
  // A weakly textured near square before a far wall: the square is brighter. With p2 lowered across the step in brightness the disparity
  // step follows it; with p2 everywhere the noise moves it.
  constexpr uint32_t w = 200, h = 100;
  StereoPair far = random_dots(w, h, 4, 0, 12), near = random_dots(w, h, 14, 0, 13), pair{w, h, far.left, far.right};
  std::mt19937 random(14);
  const auto weak = [&](uint8_t value, int level) { return static_cast<uint8_t>(level + value / 32 + static_cast<int>(random() % 7)); };
  for (uint32_t y = 0; y < h; ++y)
    for (uint32_t x = 0; x < w; ++x) {
      const auto inside = [&](uint32_t left, uint32_t right) { return y >= 30 && y < 70 && x >= left && x < right; };
      const size_t i = y * w + x;
      pair.left[i] = inside(80, 140) ? weak(near.left[i], 120) : weak(far.left[i], 60);
      pair.right[i] = inside(66, 126) ? weak(near.right[i], 120) : weak(far.right[i], 60);
    }
  MatchParameters p = searching(32);
  p.subpixel = Subpixel::none;
  p.uniqueness_ratio = 0;
  p.lr_max_diff = -1;
  const auto wrong = [&] {
    const Match m = match_on_cpu(pair, p);
    size_t bad = 0;
    for (uint32_t y = 20; y < 80; ++y)
      for (uint32_t x = 100; x < 160; ++x) {  // around the right edge: nothing is occluded there
        const float truth = y >= 30 && y < 70 && x < 140 ? 14.0f : 4.0f;
        bad += std::abs(m.disparity[y * w + x] - truth) > 1;
      }
    return bad;
  };
  const size_t fixed = wrong();
  p.p2_full_gradient_dn = 8;
  EXPECT_LT(wrong(), fixed);
}

TEST(confidence, is_higher_where_the_pair_is_cleaner) {
  double mean[2];
  for (const uint32_t noise : {0u, 1u}) {
    const Match m = match_on_cpu(random_dots(160, 80, 12, 40 * noise, 16), searching(32));
    double sum = 0;
    for (const float c : m.confidence) {
      ASSERT_GE(c, 0.0f);
      ASSERT_LE(c, 1.0f);
      sum += c;
    }
    mean[noise] = sum / static_cast<double>(m.confidence.size());
  }
  EXPECT_GT(mean[0], mean[1] + 0.1);
}

std::vector<MatchParameters> each_engine() {
  MatchParameters bytes, block, diagonals;
  bytes.max_disparity = block.max_disparity = diagonals.max_disparity = 32;
  block.block_width = block.block_height = 5;
  diagonals.path_count = 8;
  return {bytes, block, diagonals};
}

TEST(match_progress, rises_to_the_end_on_the_callers_thread) {
  const StereoPair pair = random_dots(200, 300, 9, 10, 1);
  for (const MatchParameters& p : each_engine()) {
    for (const unsigned threads : {1u, 3u}) {
      ks::ThreadPool workers(threads);
      const auto matcher = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
      std::vector<float> fractions;
      matcher->set_progress([&, caller = std::this_thread::get_id()](float done) {
        EXPECT_EQ(std::this_thread::get_id(), caller);
        fractions.push_back(done);
      });
      const auto with = match(*matcher, pair);
      EXPECT_TRUE(std::is_sorted(fractions.begin(), fractions.end()));
      if (threads == 1) {  // with more, the others may take all there is to do
        ASSERT_GT(fractions.size(), 4u);
        EXPECT_GT(fractions.back(), 0.5f);
      }
      if (!fractions.empty()) {
        EXPECT_GE(fractions.front(), 0.0f);
        EXPECT_LE(fractions.back(), 1.0f);
      }
      matcher->set_progress(nullptr);
      expect_same(with, match(*matcher, pair), pair.width, describe(pair.width, pair.height, p));
    }
  }
}

TEST(match_progress, may_stop_the_match_anywhere) {
  const StereoPair pair = random_dots(200, 300, 9, 10, 2);
  for (const MatchParameters& p : each_engine()) {
    ks::ThreadPool workers(1);
    const auto matcher = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
    const auto expected = match(*matcher, pair);
    for (const int calls : {1, 2, 4, 7}) {
      int reports = 0;
      matcher->set_progress([&](float) {
        if (++reports == calls) throw std::runtime_error("stop");
      });
      EXPECT_THROW(match(*matcher, pair), std::runtime_error);
      EXPECT_EQ(reports, calls);
    }
    matcher->set_progress(nullptr);
    expect_same(expected, match(*matcher, pair), pair.width, describe(pair.width, pair.height, p));
  }
}

}  // namespace
