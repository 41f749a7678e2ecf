// What the matcher has beyond the published SimSense: by hand in the scalar reference, and as laws of the CPU engine (which gives the
// reference's bits, matcher_exact_test.cpp).
#include <gtest/gtest.h>

#include <bit>

#include "device/thread_pool.h"
#include "reference/census.h"
#include "reference/cost.h"
#include "reference/disparity.h"
#include "reference/sgm.h"
#include "simsense/match/stereo_pair.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

Match match_on_cpu(const StereoPair& pair, const MatchParameters& p, bool wide = false) {
  ks::ThreadPool workers(2);
  return match_all(*make_cpu_matcher(pair.width, pair.height, p, workers), pair, wide);
}

size_t count(const std::vector<MatchReason>& reasons, MatchReason wanted) {
  return static_cast<size_t>(std::count(reasons.begin(), reasons.end(), wanted));
}

TEST(plain_census, every_pixel_but_the_centre_is_one_bit) {
  constexpr size_t side = 20;
  std::vector<uint8_t> image(side * side, 100);
  const auto at_centre = [&] { return census({image.data(), side}, side, side, 9, 7, CensusKind::plain).at(10, 10); };
  EXPECT_EQ(at_centre(), 0u) << "equal pixels give 0";
  uint64_t all = 0;
  for (size_t k = 0; k < 63; ++k) {
    uint8_t& pixel = image[(10 - 3 + k / 9) * side + 10 - 4 + k % 9];
    pixel = k == 31 ? 101 : 99;  // the centre brighter than all, or another one darker
    EXPECT_EQ(std::popcount(at_centre()), k == 31 ? 62 : 1);
    if (k != 31) all |= at_centre();
    pixel = 100;
  }
  EXPECT_EQ(std::popcount(all), 62);
}

TEST(census, sixteen_bits_tell_apart_what_eight_do_not) {
  std::vector<uint16_t> image(25, 1000);
  image[6] = 1001;  // first of a pair with its mirror 18
  image[18] = 1002;
  const ConstImage wide{reinterpret_cast<const uint8_t*>(image.data()), 5, 2};
  EXPECT_EQ(census(wide, 5, 5, 3, 3).at(2, 2), 0b1110u);
}

TEST(hamming_cost, starts_at_the_first_disparity) {
  Grid<uint64_t> left(4, 1), right(4, 1);
  left.data = {0, 0, 0, 0};
  right.data = {1, 3, 7, 15};
  const auto behind = hamming_cost(left, right, 2, -2), ahead = hamming_cost(left, right, 2, 1);
  EXPECT_EQ(behind.data, (std::vector<uint16_t>{3, 2, 4, 3, 4, 4, 4, 4})) << "columns 2 1, 3 2, 3 3 (4 repeats 3), 3 3";
  EXPECT_EQ(ahead.data, (std::vector<uint16_t>{1, 1, 1, 1, 2, 1, 3, 2}));
}

TEST(jump_penalty, falls_with_the_gradient_but_not_below_p1) {
  const std::vector<uint8_t> image = {0, 10, 30, 255};
  const JumpPenalty penalty{7, 86, 10, {image.data(), 4}};
  EXPECT_EQ(penalty.between(1, 0, 0, 0), 86u);
  EXPECT_EQ(penalty.between(2, 0, 1, 0), 43u);
  EXPECT_EQ(penalty.between(1, 0, 2, 0), 43u);
  EXPECT_EQ(penalty.between(3, 0, 2, 0), 7u);
}

TEST(aggregate, eight_paths_by_hand) {
  // one path per direction through the centre of a 3x3 image; only the top left pixel prefers d = 1
  Volume<uint16_t> cost(3, 3, 2);
  for (size_t i = 0; i < 9; ++i) cost.data[2 * i + 1] = 80;
  std::swap(cost.at(0, 0)[0], cost.at(0, 0)[1]);
  const auto eight = aggregate(cost, {8, 40}, 1, 8), four = aggregate(cost, {8, 40}, 1, 4);
  // into the centre: down-right brings L = {80, 0}, m = {8, 0}; the seven others bring L = {0, 80}, m = {0, 8}
  EXPECT_EQ(eight.at(1, 1)[0], 8 / 8);
  EXPECT_EQ(eight.at(1, 1)[1], 80 + 7 * 8 / 8);
  EXPECT_EQ(four.at(1, 1)[0], 0);
}

TEST(confidence, is_the_margin_that_the_uniqueness_test_asks_for) {
  Volume<uint16_t> cost(1, 1, 6);
  cost.data = {90, 60, 30, 35, 40, 80};
  EXPECT_FLOAT_EQ(confidence(cost).data[0], 1.0f - 30.0f / 40.0f);
  EXPECT_GE(left_winner(cost, 25, Subpixel::none, nullptr).data[0], 0.0f);
  EXPECT_EQ(left_winner(cost, 26, Subpixel::none, nullptr).data[0], -1.0f);
  cost.data = {0, 0, 0, 0, 0, 0};
  EXPECT_EQ(confidence(cost).data[0], 0.0f);
}

TEST(equiangular_summed, looks_at_the_aggregated_costs_alone) {
  Volume<uint16_t> summed(1, 1, 5), block(1, 1, 5);
  summed.data = {90, 60, 10, 50, 90};
  block.data = {9, 8, 2, 6, 9};
  EXPECT_FLOAT_EQ(left_winner(summed, 0, Subpixel::equiangular_summed, &block).data[0], 2.0f + (60 - 50) / 100.0f);
}

TEST(min_disparity, moves_the_searched_range) {
  MatchParameters p;
  p.max_disparity = 32;
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
  MatchParameters p;
  p.max_disparity = 16;
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
  MatchParameters p;
  p.max_disparity = 64;
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
  MatchParameters p;
  p.max_disparity = 32;
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
  p.p2_full_gradient = 8;
  EXPECT_LT(wrong(), fixed);
}

TEST(match_reason, is_given_for_every_invalid_pixel_and_for_no_other) {
  StereoPair pair = random_dots(160, 80, 12, 10, 15);
  for (uint32_t y = 20; y < 60; ++y)
    for (uint32_t x = 100; x < 140; ++x) pair.right[y * 160 + x] = static_cast<uint8_t>(37 * x * y);  // seen by one eye alone
  MatchParameters p;
  p.max_disparity = 32;
  const Match m = match_on_cpu(pair, p);
  for (size_t i = 0; i < m.disparity.size(); ++i) {
    ASSERT_EQ(m.disparity[i] < 0, m.reason[i] != MatchReason::valid);
    ASSERT_EQ(m.disparity[i] < 0 && m.confidence[i] != 0, false);
  }
  EXPECT_GT(count(m.reason, MatchReason::not_unique), 200u);
  EXPECT_GT(count(m.reason, MatchReason::outside), 20u);
  EXPECT_GT(count(m.reason, MatchReason::valid), 8000u);
}

TEST(confidence, is_higher_where_the_pair_is_cleaner) {
  MatchParameters p;
  p.max_disparity = 32;
  double mean[2];
  for (const uint32_t noise : {0u, 1u}) {
    const Match m = match_on_cpu(random_dots(160, 80, 12, 40 * noise, 16), p);
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

TEST(sixteen_bit_images, give_what_their_eight_bit_originals_give) {
  const StereoPair pair = random_dots(160, 80, 12, 10, 17);
  MatchParameters p;
  p.max_disparity = 32;
  EXPECT_EQ(match_on_cpu(pair, p, true).disparity, match_on_cpu(pair, p, false).disparity);
}

}  // namespace
