// The CPU matcher gives the bits of the scalar reference: over fuzzed parameters and sizes, thread counts, and every instruction set of
// this machine.
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <random>

#include "device/thread_pool.h"
#include "simsense/stages/stereo_pair.h"

namespace {

using simsense::MatchParameters;

std::string describe(size_t width, size_t height, const MatchParameters& p) {
  std::ostringstream text;
  text << width << "x" << height << " D " << p.max_disparity << " census " << p.census_width << "x" << p.census_height << " block "
       << p.block_width << "x" << p.block_height << " p1 " << p.p1 << " p2 " << p.p2 << " uniqueness " << p.uniqueness_ratio << " lr "
       << p.lr_max_diff << " median " << p.median_size << " subpixel " << static_cast<int>(p.subpixel) << " plain "
       << (p.census == simsense::CensusKind::plain) << " min " << p.min_disparity << " paths " << p.path_count << " gradient "
       << p.p2_full_gradient;
  return text.str();
}

/// Every pixel equal, or where the first difference is.
template <class T>
void expect_same(const std::vector<T>& expected, const std::vector<T>& actual, size_t width, const std::string& what) {
  const auto [e, a] = std::mismatch(expected.begin(), expected.end(), actual.begin());
  if (e == expected.end()) return;
  const size_t at = static_cast<size_t>(e - expected.begin());
  size_t count = 0;
  for (size_t i = 0; i < expected.size(); ++i) count += expected[i] != actual[i];
  ADD_FAILURE() << what << ": " << count << " pixels differ, first at x " << at % width << " y " << at / width << ": expected "
                << static_cast<float>(*e) << ", got " << static_cast<float>(*a);
}

void compare(const StereoPair& pair, const MatchParameters& p, unsigned threads) {
  ks::ThreadPool workers(threads);
  const auto reference = simsense::make_reference_matcher(pair.width, pair.height, p);
  const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
  const auto expected = match(*reference, pair);
  const std::string what = describe(pair.width, pair.height, p) + " threads " + std::to_string(threads);
  expect_same(expected, match(*cpu, pair), pair.width, what);
  expect_same(expected, match(*cpu, pair), pair.width, what + ", second call");
}

/// Disparity, confidence and reason; on wide images too if asked.
void compare_all(const StereoPair& pair, const MatchParameters& p, unsigned threads, bool wide) {
  ks::ThreadPool workers(threads);
  const auto reference = simsense::make_reference_matcher(pair.width, pair.height, p);
  const auto cpu = simsense::make_cpu_matcher(pair.width, pair.height, p, workers);
  const Match expected = match_all(*reference, pair, wide), actual = match_all(*cpu, pair, wide);
  const std::string what = describe(pair.width, pair.height, p) + " threads " + std::to_string(threads) + (wide ? " wide" : "");
  expect_same(expected.disparity, actual.disparity, pair.width, what + ": disparity");
  expect_same(expected.confidence, actual.confidence, pair.width, what + ": confidence");
  expect_same(expected.reason, actual.reason, pair.width, what + ": reason");
  expect_same(expected.disparity, match(*cpu, pair), pair.width, what + ": disparity alone");
}

class Fuzz {
 public:
  explicit Fuzz(unsigned seed) : random_(seed) {}
  uint32_t in(uint32_t low, uint32_t high) { return std::uniform_int_distribution<uint32_t>(low, high)(random_); }
  template <size_t n>
  uint32_t one_of(const uint32_t (&values)[n]) {
    return values[in(0, n - 1)];
  }
  MatchParameters parameters(bool block) {
    MatchParameters p;
    static constexpr uint32_t windows[][2] = {{7, 7}, {7, 7}, {9, 7}, {7, 9}, {5, 5}, {3, 3}, {65, 1}, {1, 65}, {13, 5}, {1, 1}};
    const auto& window = windows[in(0, 9)];
    p.census_width = window[0];
    p.census_height = window[1];
    p.max_disparity = in(0, 3) == 0 ? in(16, 300) : in(16, 70);
    static constexpr uint32_t blocks[][2] = {{7, 7}, {3, 5}, {5, 1}, {1, 9}, {15, 17}, {255, 1}, {1, 255}, {11, 3}};
    const auto& size = blocks[in(0, 7)];
    p.block_width = block ? size[0] : 1;
    p.block_height = block ? size[1] : 1;
    p.p2 = in(2, 223);
    p.p1 = in(1, p.p2 - 1);
    p.uniqueness_ratio = one_of({0, 5, 15, 40, 100});
    p.lr_max_diff = static_cast<int32_t>(in(0, 4)) - 1;
    p.median_size = one_of({1, 3, 5, 7});
    p.subpixel = static_cast<simsense::Subpixel>(in(0, 2));
    return p;
  }
  /// Those that only the CPU knows, mixed with the others.
  MatchParameters all_parameters(bool block) {
    MatchParameters p = parameters(block);
    if (in(0, 1)) {
      static constexpr uint32_t windows[][2] = {{9, 7}, {7, 9}, {7, 7}, {5, 5}, {7, 5}, {3, 3}, {63, 1}};
      const auto& window = windows[in(0, 6)];
      p.census = simsense::CensusKind::plain;
      p.census_width = window[0];
      p.census_height = window[1];
      while (p.block_area() * (p.census_bits() + p.p2) > 65535) p.block_width = p.block_height = 3;
    }
    if (in(0, 2) > 0) p.min_disparity = static_cast<int32_t>(in(0, 60)) - 30;
    if (in(0, 5) == 0) p.min_disparity = static_cast<int32_t>(in(0, 400)) - 200;
    if (in(0, 1)) p.path_count = 8;
    if (in(0, 1)) p.p2_full_gradient = in(1, 60);
    if (in(0, 3) == 0) p.subpixel = simsense::Subpixel::equiangular_summed;
    return p;
  }
  StereoPair pair() { return random_dots(in(32, 150), in(32, 100), in(0, 20), in(0, 25), in(0, 1u << 30)); }

 private:
  std::mt19937 random_;
};

TEST(matcher, fuzzed_parameters_without_block_equal_the_reference) {
  Fuzz fuzz(1);
  for (int i = 0; i < 40; ++i) compare(fuzz.pair(), fuzz.parameters(false), fuzz.in(1, 4));
}

TEST(matcher, fuzzed_parameters_with_block_equal_the_reference) {
  Fuzz fuzz(2);
  for (int i = 0; i < 25; ++i) compare(fuzz.pair(), fuzz.parameters(true), fuzz.in(1, 4));
}

TEST(matcher, fuzzed_extensions_without_block_equal_the_reference) {
  Fuzz fuzz(11);
  for (int i = 0; i < 60; ++i) compare_all(fuzz.pair(), fuzz.all_parameters(false), fuzz.in(1, 4), false);
}

TEST(matcher, fuzzed_extensions_with_block_equal_the_reference) {
  Fuzz fuzz(12);
  for (int i = 0; i < 40; ++i) compare_all(fuzz.pair(), fuzz.all_parameters(true), fuzz.in(1, 4), false);
}

TEST(matcher, fuzzed_16_bit_images_equal_the_reference) {
  Fuzz fuzz(13);
  for (int i = 0; i < 20; ++i) {
    MatchParameters p = fuzz.all_parameters(i % 3 == 0);
    p.p2_full_gradient *= 257;
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

TEST(matcher, byte_engine_equals_the_reference_at_its_limits) {
  MatchParameters p;
  p.p1 = 126;
  p.p2 = 127;
  p.max_disparity = 256;
  p.census_width = 65;
  p.census_height = 1;
  compare(random_dots(97, 65, 12, 40, 3), p, 2);
}

TEST(matcher, widest_sums_equal_the_reference) {
  MatchParameters p;
  p.p2 = 223;
  p.block_width = 15;
  p.block_height = 17;
  p.census_width = 65;
  p.census_height = 1;
  p.max_disparity = 40;
  compare(random_dots(64, 48, 6, 60, 4), p, 2);
}

TEST(matcher, thousand_disparities_equal_the_reference) {
  MatchParameters p;
  p.max_disparity = 1024;
  compare(random_dots(64, 32, 9, 10, 5), p, 1);
}

TEST(matcher, sensor_size_equals_the_reference) {
  const StereoPair pair = random_dots(960, 540, 37, 10, 6);
  compare(pair, MatchParameters{}, 2);
}

TEST(matcher, every_instruction_set_of_this_machine_equals_the_reference) {
  const auto targets = hwy::SupportedAndGeneratedTargets();
  ASSERT_FALSE(targets.empty());
  for (const int64_t target : targets) {
    SCOPED_TRACE(hwy::TargetName(target));
    hwy::SetSupportedTargetsForTest(target);
    Fuzz fuzz(7);
    for (int i = 0; i < 6; ++i) compare(fuzz.pair(), fuzz.parameters(i % 2 == 1), 2);
    for (int i = 0; i < 8; ++i) compare_all(fuzz.pair(), fuzz.all_parameters(i % 2 == 1), 2, false);
    hwy::SetSupportedTargetsForTest(0);
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
