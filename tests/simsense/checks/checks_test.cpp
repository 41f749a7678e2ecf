// SPDX-License-Identifier: Apache-2.0
// Speckle filter, hole filling and other checks against OpenCV and by hand.
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "cpu/checks/checks.h"
#include "device/thread_pool.h"
#include "simsense/match/volumes.h"
#include "simsense/reference/match.h"

namespace {

using namespace simsense;
using namespace simsense::reference;

/// A disparity with its confidence and reason.
struct Checked {
  std::vector<float> disparity, confidence;
  std::vector<MatchReason> reason;

  explicit Checked(size_t pixels, float value = 0)
      : disparity(pixels, value), confidence(pixels, 0.5f), reason(pixels, MatchReason::valid) {}
  MatchMaps maps() {
    MatchMaps out = disparity.data();
    out.confidence = confidence.data();
    out.reason = reason.data();
    return out;
  }
  /// A pixel went for this reason, or stays with what it had.
  void expect(size_t i, float before, MatchReason why) const {
    const bool stays = why == MatchReason::valid;
    ASSERT_EQ(disparity[i], stays ? before : -1.0f) << i;
    ASSERT_EQ(reason[i], why) << i;
    ASSERT_EQ(confidence[i], stays ? 0.5f : 0.0f) << i;
  }
};

std::vector<float> filtered(std::vector<float> disparity, uint32_t width, float invalid, uint32_t max_size, float max_diff,
                            unsigned threads) {
  ks::ThreadPool workers(threads);
  SpeckleFilter filter;
  filter.apply(disparity.data(), width, static_cast<uint32_t>(disparity.size()) / width, invalid, max_size, max_diff, workers);
  return disparity;
}

TEST(SpeckleFilter, EqualsOpenCvs) {
  std::mt19937 random(1);
  for (int i = 0; i < 30; ++i) {
    const uint32_t width = 20 + random() % 90, height = 20 + random() % 90, levels = 2 + random() % 5;
    std::vector<float> disparity(width * height);
    for (float& d : disparity) d = random() % 3 == 0 ? -1.0f : 10.0f + 0.75f * static_cast<float>(random() % levels);
    const uint32_t max_size = random() % 40;
    const float max_diff = 0.75f * static_cast<float>(random() % 3);
    cv::Mat quarters;  // OpenCV takes whole numbers
    cv::Mat(static_cast<int>(height), static_cast<int>(width), CV_32F, disparity.data()).convertTo(quarters, CV_16S, 4);
    cv::filterSpeckles(quarters, -4, static_cast<int>(max_size), double{4 * max_diff});
    quarters.convertTo(quarters, CV_32F, 0.25);
    const std::vector<float> expected(quarters.begin<float>(), quarters.end<float>());
    ASSERT_EQ(filtered(disparity, width, -1, max_size, max_diff, 1), expected) << width << "x" << height;
    ASSERT_EQ(filtered(disparity, width, -1, max_size, max_diff, 3), expected) << width << "x" << height;
  }
}

TEST(SpeckleFilter, SlopeIsOneIslandAndNotesAreKept) {
  Checked slope(40 * 33);
  for (size_t i = 0; i < slope.disparity.size(); ++i) slope.disparity[i] = static_cast<float>(i % 40);
  slope.disparity[5] = 90;
  ks::ThreadPool workers(2);
  SpeckleFilter().apply(slope.maps(), 40, 33, -1, 100, 1, workers);
  for (size_t i = 0; i < slope.disparity.size(); ++i)
    slope.expect(i, static_cast<float>(i % 40), i == 5 ? MatchReason::speckle : MatchReason::valid);
}

TEST(HoleFilling, ByHand) {
  const std::vector<float> row{-1, 5, -1, -1, 9, 3, -1, 7, -1}, empty(9, -1.0f);
  ks::ThreadPool workers(1);
  const auto fill = [&](HoleFilling filling, std::vector<float> values) {
    fill_holes(filling, values.data(), 9, {0, 0, 9, 1}, -1, workers);
    return values;
  };
  EXPECT_EQ(fill(HoleFilling::keep, row), row);
  EXPECT_EQ(fill(HoleFilling::left, row), (std::vector<float>{-1, 5, 5, 5, 9, 3, 3, 7, 7}));
  EXPECT_EQ(fill(HoleFilling::background, row), (std::vector<float>{5, 5, 5, 5, 9, 3, 3, 7, 7}));
  EXPECT_EQ(fill(HoleFilling::background, empty), empty);
  std::vector<float> part = row;
  fill_holes(HoleFilling::background, part.data(), 9, {2, 0, 5, 1}, -1, workers);
  EXPECT_EQ(part, (std::vector<float>{-1, 5, 9, 9, 9, 3, -1, 7, -1})) << "what lies outside the region is not looked at";
}

/// Every square looked through by itself: faint noise, with a spot here and there.
template <class T>
void expect_blank_squares_dropped(uint32_t width, uint32_t height, uint32_t spots, unsigned threads, std::mt19937& random) {
  constexpr uint32_t reach = TextureParameters::window_reach, drop_reach = TextureParameters::drop_reach;
  std::vector<T> image(size_t{width} * height);
  for (T& count : image) count = static_cast<T>(40 + random() % 2);
  for (uint32_t i = 0; i < spots; ++i) image[random() % image.size()] = static_cast<T>(39 + random() % 4);  // 39 and 42 make a difference
  Checked checked(image.size(), 10);
  for (float& d : checked.disparity)
    if (random() % 5 == 0) d = -1;
  const std::vector<float> before = checked.disparity;
  ks::ThreadPool workers(threads);
  const ConstImage left{reinterpret_cast<const uint8_t*>(image.data()), static_cast<ptrdiff_t>(width), sizeof(T)};
  TextureCheck().apply({2}, left, width, height, checked.maps(), -1, workers);
  const cv::Mat counts = cv::Mat_<T>(image).reshape(1, static_cast<int>(height));
  const auto square = [](uint32_t far) { return cv::Mat::ones(2 * static_cast<int>(far) + 1, 2 * static_cast<int>(far) + 1, CV_8U); };
  cv::Mat low, high, drops;
  cv::erode(counts, low, square(reach));
  cv::dilate(counts, high, square(reach));
  cv::dilate(high - low < 2, drops, square(drop_reach));
  size_t dropped = 0;
  for (uint32_t i = 0; i < image.size(); ++i) {
    const bool goes = drops.data[i] != 0 && before[i] >= 0;
    dropped += goes;
    checked.expect(i, before[i], goes ? MatchReason::low_texture : MatchReason::valid);
  }
  EXPECT_GT(dropped, image.size() / 50);
  EXPECT_LT(dropped, image.size() * 3 / 4);
}

TEST(Texture, PixelsInsideOfABlankSquareAreDropped) {
  std::mt19937 random(3);
  expect_blank_squares_dropped<uint8_t>(97, 70, 12, 1, random);
  expect_blank_squares_dropped<uint8_t>(64, 33, 4, 3, random);
  expect_blank_squares_dropped<uint16_t>(131, 65, 24, 2, random);
}

TEST(Edges, BothSidesOfAStepGoAndWhatIsMatchedAtTheRightImagesEdges) {
  constexpr uint32_t width = 40, height = 9;
  Checked step(width * height);
  for (uint32_t i = 0; i < width * height; ++i) step.disparity[i] = i % width < 20 ? 10.0f : 12.5f;
  step.disparity[4 * width + 30] = -1;  // a hole is no step
  ks::ThreadPool workers(3);
  EdgeCheck().apply({.step_px = 2, .border_px = 3}, step.maps(), width, height, -1, workers);
  for (uint32_t i = 0; i < width * height; ++i) {
    const uint32_t x = i % width;
    const bool is_outside = x < 13, is_step = x == 19 || x == 20;  // the right edge is beyond every match
    if (i == 4 * width + 30) continue;
    step.expect(i, x < 20 ? 10.0f : 12.5f, is_outside ? MatchReason::outside : is_step ? MatchReason::not_unique : MatchReason::valid);
  }
  std::vector<float> disparity(width * height);
  EdgeCheck().apply({.step_px = 0, .border_px = 2}, disparity.data(), width, height, -1, workers);
  for (uint32_t x = 0; x < width; ++x) ASSERT_EQ(disparity[x], x < 2 || x >= width - 2 ? -1.0f : 0.0f) << x;
}

TEST(Reason, TheImageExplainsWhatStagesRejected) {
  std::vector<uint8_t> image(60 * 40);
  for (size_t y = 0; y < 40; ++y)
    for (size_t x = 0; x < 60; ++x)
      image[y * 60 + x] = x < 20 ? static_cast<uint8_t>(100 + (x + y) % 4) : x < 40 ? 255 : static_cast<uint8_t>(40 * ((x + y) % 4));
  std::vector<MatchReason> reason(image.size(), MatchReason::not_unique);
  std::fill_n(reason.begin(), 60 * 10, MatchReason::valid);
  std::fill_n(reason.begin() + 60 * 10, 60 * 10, MatchReason::outside);
  ks::ThreadPool workers(2);
  find_reasons({7, 7, 4, 255}, {image.data(), 60}, 60, 40, reason.data(), workers);
  EXPECT_EQ(reason[5 * 60 + 10], MatchReason::valid);
  EXPECT_EQ(reason[15 * 60 + 10], MatchReason::outside) << "geometry needs no other cause";
  EXPECT_EQ(reason[30 * 60 + 10], MatchReason::low_texture);
  EXPECT_EQ(reason[30 * 60 + 30], MatchReason::saturated);
  EXPECT_EQ(reason[30 * 60 + 50], MatchReason::not_unique);
}

TEST(left_right_check, by_hand) {
  Grid<uint32_t> right(5, 1);
  right.data = {1, 2, 0, 0, 0};
  // x 0: 0 against right[0] = 1. x 1: 1.4 rounds to 1, right[0] = 1. x 2: 0.5 rounds up to 1, right[1] = 2. x 3: 2.6 rounds to 3,
  // right[0] = 1. x 4: 5 points outside
  const auto left = grid(5, 1, {0.0f, 1.4f, 0.5f, 2.6f, 5.0f});
  EXPECT_EQ(left_right_check(left, right, 1).data, (std::vector<float>{0.0f, 1.4f, 0.5f, -1.0f, -1.0f}));
  EXPECT_EQ(left_right_check(left, right, 0).data, (std::vector<float>{-1.0f, 1.4f, -1.0f, -1.0f, -1.0f}));
  EXPECT_EQ(left_right_check(left, right, 2).data, (std::vector<float>{0.0f, 1.4f, 0.5f, 2.6f, -1.0f}));
}

TEST(median, by_hand_with_invalid_values_and_copied_border) {
  const auto map = grid(4, 3,
                        {-1, 5, 3, 8,  //
                         7, 90, 2, 9,  //
                         4, -1, 6, 1});
  // centre windows: {-1 5 3 7 90 2 4 -1 6} -> 4 and {5 3 8 90 2 9 -1 6 1} -> 5
  EXPECT_EQ(median(map, 3).data, (std::vector<float>{-1, 5, 3, 8, 7, 4, 5, 9, 4, -1, 6, 1}));
  EXPECT_EQ(median(map, 1).data, map.data);
}

TEST(median, keeps_a_plane_and_removes_a_speck) {
  for (const size_t size : {3u, 5u, 7u}) {
    Grid<float> plane(20, 20);
    for (size_t y = 0; y < 20; ++y) {
      for (size_t x = 0; x < 20; ++x) plane.at(x, y) = static_cast<float>(3 * x + 2 * y);
    }
    EXPECT_EQ(median(plane, size).data, plane.data);
    Grid<float> flat(20, 20, 8.0f);
    const auto expected = flat.data;
    flat.at(10, 10) = 77.0f;
    EXPECT_EQ(median(flat, size).data, expected);
  }
}

}  // namespace
