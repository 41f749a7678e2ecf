// SPDX-License-Identifier: Apache-2.0
// What the matcher owes its user, and the memory that it takes. The reference owes the same: exact_test.cpp finds them equal.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <tuple>

#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"
#include "simsense/match/stereo_pair.h"
#include "support/peak_memory.h"

namespace {

using simsense::MatchParameters;

std::vector<float> match_with(const StereoPair& pair, const MatchParameters& p) {
  ks::ThreadPool workers(2);
  return match(*simsense::make_cpu_matcher(pair.width, pair.height, p, workers), pair);
}

TEST(matcher_law, shifted_pair_gives_that_disparity) {
  for (const uint32_t shift : {0u, 1u, 7u, 30u, 62u}) {
    for (const uint32_t block : {1u, 7u}) {
      const StereoPair pair = random_dots(160, 70, shift, 3, shift + 1);
      MatchParameters p = searching(64, block);
      p.subpixel = simsense::Subpixel::none;
      const auto whole = match_with(pair, p);
      p.subpixel = simsense::Subpixel::parabola;
      const auto fine = match_with(pair, p);
      for (uint32_t y = 4; y < 66; ++y) {
        for (uint32_t x = shift + 8; x < 152; ++x) {
          ASSERT_EQ(whole[y * 160 + x], static_cast<float>(shift)) << "x " << x << " y " << y << " block " << block;
          ASSERT_NEAR(fine[y * 160 + x], shift, 0.5) << "x " << x << " y " << y << " block " << block;
        }
      }
    }
  }
}

/// Gaussian dots of this width on even light, `shift` pixels further right in the left image; vignetting: share lost at the side borders.
StereoPair fine_dots(double sigma, double shift, double vignetting, double dot_dn, double even_dn) {
  constexpr uint32_t width = 160, height = 96;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> place(-4.0, width + 24.0), row(-4.0, height + 4.0);
  std::vector<double> light[2];
  for (auto& image : light) image.assign(size_t{width} * height, even_dn);
  for (int dot = 0; dot < 450; ++dot) {
    const double x = place(random), y = row(random);
    for (uint32_t v = 0; v < height; ++v) {
      const double across = std::exp(-0.5 * (v - y) * (v - y) / (sigma * sigma));
      if (across < 1e-4) continue;
      for (uint32_t u = 0; u < width; ++u)
        for (int side = 0; side < 2; ++side) {
          const double off = (u - (side == 0 ? x : x - shift)) / sigma;
          light[side][v * width + u] += dot_dn * across * std::exp(-0.5 * off * off);
        }
    }
  }
  StereoPair pair{width, height, {}, {}};
  std::uniform_int_distribution<int> noise(-1, 1);
  for (int side = 0; side < 2; ++side)
    for (size_t i = 0; i < light[side].size(); ++i) {
      const double off = 2.0 * static_cast<double>(i % width) / width - 1, value = light[side][i] * (1 - vignetting * off * off);
      (side == 0 ? pair.left : pair.right).push_back(static_cast<uint8_t>(std::clamp(std::lround(value) + noise(random), 0L, 255L)));
    }
  return pair;
}

/// Largest mean error of walls at eight fractions of a pixel.
double worst_pull(simsense::Subpixel subpixel, double sigma, double vignetting = 0, double dot_dn = 60, double even_dn = 20) {
  MatchParameters p = searching(32, 5);
  p.subpixel = subpixel;
  p.median_size = 7;
  double worst = 0;
  for (int eighth = 0; eighth < 8; ++eighth) {
    const double shift = 9.0 + eighth / 8.0;
    const StereoPair pair = fine_dots(sigma, shift, vignetting, dot_dn, even_dn);
    const auto found = match_with(pair, p);
    double sum = 0, count = 0;
    for (uint32_t y = 8; y + 8 < pair.height; ++y)
      for (uint32_t x = 24; x + 8 < pair.width; ++x)
        if (const double d = found[y * pair.width + x]; d >= 0) sum += d - shift, ++count;
    worst = std::max(worst, std::abs(sum / count));
  }
  return worst;
}

TEST(matcher_law, refined_disparities_are_not_pulled_to_whole_pixels) {
  for (const double sigma : {0.6, 1.0, 1.8}) {
    EXPECT_LT(worst_pull(simsense::Subpixel::lucas_kanade, sigma), 0.015) << sigma;
    EXPECT_GT(worst_pull(simsense::Subpixel::equiangular_summed, sigma), 0.04) << sigma;
  }
}

TEST(matcher_law, vignetting_does_not_pull_refined_disparities) {
  EXPECT_LT(worst_pull(simsense::Subpixel::lucas_kanade, 1.0, 0.7, 8, 120), 0.04);
}

TEST(matcher_law, noise_around_a_thing_gets_no_disparity) {
  StereoPair pair = random_dots(200, 120, 11, 1, 3);
  std::mt19937 random(9);
  const auto is_thing = [](uint32_t x, uint32_t y) { return x >= 60 && x < 120 && y >= 40 && y < 80; };
  for (uint32_t y = 0; y < pair.height; ++y)
    for (uint32_t x = 0; x < pair.width; ++x)
      for (auto* image : {&pair.left, &pair.right})
        if (!is_thing(image == &pair.left ? x : x + 11, y)) (*image)[y * pair.width + x] = static_cast<uint8_t>(40 + random() % 3);
  pair.noise = simsense::detection_noise(4.0 / 3, 0, 0, 0, simsense::detection_mean_side(15));  // of three equally likely counts, twice
  // (share of the thing, share of what lies so far from it) with a disparity
  const auto shares = [&](float least, uint32_t far) {
    MatchParameters p = searching(32, 5);
    p.min_detection_sigma = least;
    p.detection_window = 15;
    p.uniqueness_ratio = 5;
    const auto found = match_with(pair, p);
    double thing = 0, nothing = 0, pixels = 0;
    for (uint32_t y = 0; y < pair.height; ++y)
      for (uint32_t x = 0; x < pair.width; ++x) {
        const bool is_far = x + far < 60 || x >= 120 + far || y + far < 40 || y >= 80 + far, is_found = found[y * pair.width + x] >= 0;
        thing += is_thing(x, y) && is_found;
        nothing += is_far && is_found;
        pixels += is_far;
      }
    return std::pair{thing / (60 * 40), nothing / pixels};
  };
  EXPECT_GT(shares(0, 20).second, 0.2);
  EXPECT_LT(shares(3, 20).second, 0.01);
  const auto [thing, beside] = shares(3, 2);
  EXPECT_GT(thing, 0.95);
  EXPECT_LT(beside, 0.07);  // twice as much where windows widen the thing
}

TEST(matcher_law, matches_of_a_wide_window_speak_where_counts_show_no_more_than_noise) {
  StereoPair pair = random_dots(200, 140, 11, 1, 3);
  for (auto* image : {&pair.left, &pair.right})
    for (uint8_t& count : *image) count = static_cast<uint8_t>(100 + count / 64);
  pair.noise = simsense::detection_noise(8, 0, 0, 0, simsense::detection_mean_side(31));
  MatchParameters p = searching(32);
  p.min_detection_sigma = 3;
  for (const auto& [window, least, most] : {std::tuple{31u, 0.9, 1.0}, {15u, 0.0, 0.0}}) {
    p.detection_window = window;
    double kept = 0;  // where windows lie within what both images show
    const auto found = match_with(pair, p);
    for (uint32_t y = 40; y < 100; ++y)
      for (uint32_t x = 70; x < 160; ++x) kept += found[y * pair.width + x] >= 0;
    EXPECT_GE(kept / (60 * 90), least);
    EXPECT_LE(kept / (60 * 90), most);
  }
}

TEST(matcher_law, featureless_pair_gives_disparity_zero) {
  const StereoPair pair{64, 40, std::vector<uint8_t>(64 * 40, 128), std::vector<uint8_t>(64 * 40, 128)};
  MatchParameters p = searching(32);
  for (const float disparity : match_with(pair, p)) ASSERT_EQ(disparity, 0.0f);
}

TEST(matcher_law, brighter_right_image_changes_nothing) {
  StereoPair pair = random_dots(100, 60, 11, 0, 3);
  for (auto* image : {&pair.left, &pair.right}) {
    for (uint8_t& value : *image) value = static_cast<uint8_t>(1 + value / 2);
  }
  MatchParameters p = searching(32);
  const auto expected = match_with(pair, p);
  for (uint8_t& value : pair.right) value = static_cast<uint8_t>(value + 90);  // zeros outside the image stay the darkest
  EXPECT_EQ(match_with(pair, p), expected);
}

TEST(matcher_law, contrast_lets_faint_noise_change_little) {
  // up to two counts on texture of a hundred and more
  const auto share_different = [](uint32_t contrast) {
    StereoPair pair = random_dots(160, 80, 11, 0, 3), noisy = pair;
    std::mt19937 random(7);
    for (auto* image : {&noisy.left, &noisy.right}) {
      for (uint8_t& value : *image) value = static_cast<uint8_t>(std::min<unsigned>(255, value + random() % 3));
    }
    MatchParameters p = searching(32, 1);
    p.p1 = 7;
    p.p2 = 86;  // the published penalties: weaker ones leave almost no pixel that noise changes
    p.census_contrast_256ths = contrast;
    const auto clean = match_with(pair, p), found = match_with(noisy, p);
    size_t different = 0;
    for (size_t i = 0; i < clean.size(); ++i) different += std::abs(clean[i] - found[i]) > 0.25f;
    return static_cast<double>(different) / static_cast<double>(clean.size());
  };
  EXPECT_LT(share_different(26), 0.5 * share_different(0));
}

TEST(matcher_law, unrelated_images_are_mostly_rejected) {
  StereoPair pair = random_dots(160, 80, 0, 0, 4);
  pair.right = random_dots(160, 80, 0, 0, 5).right;
  const auto disparity = match_with(pair, searching(64));
  const auto valid = std::count_if(disparity.begin(), disparity.end(), [](float d) { return d >= 0.0f; });
  EXPECT_LT(static_cast<double>(valid), 0.2 * static_cast<double>(disparity.size()));
}

TEST(matcher_law, both_cameras_agree) {
  // seen from the other camera: both images mirrored and swapped. Where both views keep a disparity it is the same one.
  const StereoPair pair = random_dots(160, 60, 13, 20, 6);
  StereoPair swapped = pair;
  for (size_t y = 0; y < 60; ++y) {
    std::reverse_copy(&pair.right[y * 160], &pair.right[y * 160] + 160, &swapped.left[y * 160]);
    std::reverse_copy(&pair.left[y * 160], &pair.left[y * 160] + 160, &swapped.right[y * 160]);
  }
  MatchParameters p = searching(32);
  const auto left = match_with(pair, p), right = match_with(swapped, p);
  size_t both = 0;
  for (size_t y = 4; y < 56; ++y) {
    for (size_t x = 45; x < 147; ++x) {
      const float from_left = left[y * 160 + x], from_right = right[y * 160 + 159 - (x - 13)];
      if (from_left < 0.0f || from_right < 0.0f) continue;
      ++both;
      ASSERT_NEAR(from_left, from_right, 0.5);
    }
  }
  EXPECT_GT(both, 52u * 102u * 9 / 10);
}

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool sanitized = true;
#else
constexpr bool sanitized = false;
#endif

TEST(matcher_memory, of_a_sensor_sized_pair_stays_below_45_megabytes) {
  if (sanitized) GTEST_SKIP() << "a sanitizer's own memory would be measured";
  const StereoPair pair = random_dots(960, 540, 50, 10, 1);
  for (const uint32_t block : {1u, 7u}) {
    simsense::MatchParameters p;
    p.block_width = p.block_height = block;
    const ks_test::Peak peak = ks_test::peak_of([&] {
      ks::ThreadPool workers(2);
      const auto matcher = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
      for (int i = 0; i < 2; ++i) match(*matcher, pair);
    });
    if (!peak.ok) GTEST_SKIP() << "/proc/self/status does not tell VmRSS and VmHWM here";
    EXPECT_LT(peak.megabytes, block == 1 ? 25.0 : 45.0) << "block " << block;
    EXPECT_GT(peak.megabytes, 5.0) << "block " << block << ": less than the census images alone take";
  }
}

}  // namespace
