// SPDX-License-Identifier: Apache-2.0
// The Vulkan matcher gives the scalar reference's bits: fuzzed parameters and sizes, 8 and 16 bit, lane layouts, minima, batches.
#include <gtest/gtest.h>

#include <sstream>

#include "capi/device/devices.h"
#include "device/error.h"
#include "simsense/match/matcher_fuzz.h"
#include "vulkan/matcher.h"

namespace {

using simsense::BlockCosts;
using simsense::MatchTuning;
using simsense::Minima;
using namespace simsense_test;

const auto device = ks::test::shared_best_device;

std::string describe(const StereoPair& pair, const MatchParameters& p, const MatchTuning& t) {
  std::ostringstream text;
  text << simsense_test::describe(pair.width, pair.height, p) << "; lanes " << t.path_lanes << " steps " << t.steps << " groups "
       << t.path_group << ", " << t.winner_group << " segments " << t.segments << (t.minima == Minima::half ? " half" : "")
       << (t.block_costs == BlockCosts::summed ? " summed" : "");
  return text.str();
}

void compare(const StereoPair& pair, const MatchParameters& p, const MatchTuning& tuning = {}, bool wide = false) {
  const auto vulkan = simsense::make_vulkan_host_matcher(device(), pair.width, pair.height, p, tuning);
  const Match expected = match_all(*simsense::make_reference_matcher(pair.width, pair.height, p), pair, wide);
  const Match found = match_all(*vulkan, pair, wide);
  const std::string what = describe(pair, p, tuning);
  expect_same(expected, found, pair.width, what);
  if (!wide) expect_same(expected.disparity, match(*vulkan, pair), pair.width, what + ", second call");
}

/// Tunings, and ranges whose shaders a CPU device compiles in a second.
class VulkanFuzz : public Fuzz {
 public:
  using Fuzz::Fuzz;
  MatchParameters narrow(MatchParameters p) {
    p.max_disparity = std::min(p.max_disparity, 200u);
    return p;
  }
  MatchTuning tuning() {
    MatchTuning t;
    t.path_lanes = one_of({0, 4, 8});
    t.steps = 4;
    t.path_group = one_of({0, 16, 128});
    t.winner_group = one_of({0, 32, 256});
    t.segments = in(0, 5);
    t.minima = in(0, 1) ? Minima::half : Minima::integer;
    return t;
  }
};

TEST(vulkan_matcher, fuzzed_parameters_equal_the_reference) {
  for (const bool block : {false, true}) {
    VulkanFuzz fuzz(block ? 2 : 1);
    for (int i = 0; i < 7; ++i) compare(fuzz.pair(), fuzz.narrow(fuzz.parameters(block)), fuzz.tuning());
  }
}

TEST(vulkan_matcher, fuzzed_extensions_equal_the_reference) {
  VulkanFuzz fuzz(3);
  for (int i = 0; i < 8; ++i) {
    const bool wide = i / 2 % 2 == 1;
    compare(fuzz.pair(), fuzz.narrow(fuzz.all_parameters(i % 2 == 1)), fuzz.tuning(), wide);
  }
}

TEST(vulkan_matcher, diagonals_of_flat_and_of_tall_images_equal_the_reference) {
  MatchParameters p = searching(24);
  p.path_count = 8;
  for (const auto& [width, height] : {std::pair{130u, 32u}, {32u, 130u}, {65u, 65u}, {37u, 111u}}) {
    p.p2_full_gradient_dn = height % 2 ? 20 : 0;
    compare(random_dots(width, height, 5, 10, width), p);
  }
}

TEST(vulkan_matcher, disparities_far_from_the_image_equal_the_reference) {
  MatchParameters p = searching(20);
  for (const int32_t least : {-1024, -70, -63, 63, 70, 4096}) {
    p.min_disparity = least;
    compare(random_dots(64, 33, 5, 10, 9), p);
  }
}

TEST(vulkan_matcher, lines_of_every_length_around_a_block_of_steps_meet_right) {
  for (uint32_t extra = 0; extra < 8; ++extra) {  // odd and even remainders of both block sizes, of rows and of columns
    const MatchTuning tuning{extra % 4 < 2 ? 8u : 4u, extra % 2 ? 8u : 4u};
    compare(random_dots(32 + extra, 49 - extra, 5, 10, extra), searching(24), tuning);
  }
}

TEST(vulkan_matcher, widest_sums_equal_the_reference) { compare(random_dots(64, 48, 6, 60, 4), widest_sums()); }

TEST(vulkan_matcher, most_disparities_equal_the_reference) {
  MatchParameters p =
      searching(device()->is_cpu() ? 400 : 1024);  // a narrow subgroup's long registers take a CPU device minutes to compile
  compare(random_dots(64, 32, 9, 10, 5), p);
}

TEST(vulkan_matcher, a_large_pair_equals_the_reference) { compare(random_dots(640, 200, 37, 10, 6), MatchParameters{}); }

TEST(vulkan_matcher, a_pair_of_the_sensors_size_needs_at_most_150_megabytes) {
  MatchParameters p;
  EXPECT_LE(simsense::make_vulkan_matcher(device(), 960, 540, 1, p)->memory_bytes(), 150'000'000u);
  p.block_width = p.block_height = 7;
  EXPECT_LE(simsense::make_vulkan_matcher(device(), 960, 540, 1, p)->memory_bytes(), 280'000'000u);
  MatchTuning summed;
  summed.block_costs = BlockCosts::summed;
  EXPECT_LE(simsense::make_vulkan_matcher(device(), 960, 540, 1, p, summed)->memory_bytes(), 150'000'000u);
}

TEST(vulkan_matcher, block_costs_are_stored_unless_they_take_much_of_a_gpus_memory) {
  MatchParameters p;
  p.block_width = p.block_height = 7;
  EXPECT_TRUE(simsense::make_match_plan(*device(), 64, 64, 1, p, {}).stored_costs);
  p.max_disparity = 128;  // 34 billion costs are too much for a GPU of 139 GB; with a much longer range no workgroup could sum
  EXPECT_EQ(simsense::make_match_plan(*device(), 16384, 16384, 1, p, {}).stored_costs, device()->is_cpu());
}

TEST(vulkan_matcher, block_costs_summed_on_the_way_equal_the_reference) {
  MatchParameters p = searching(24);
  MatchTuning summed;
  summed.block_costs = BlockCosts::summed;
  summed.path_lanes = 8;  // few registers: a CPU device takes long to compile many
  for (const auto& [block_width, block_height] : {std::pair{7u, 7u}, {3u, 13u}}) {
    p.block_width = block_width;
    p.block_height = block_height;
    p.p2_full_gradient_dn = block_width == 3 ? 12 : 0;
    const StereoPair pair = random_dots(64 + block_width, 49 + block_height, 6, 10, block_width);
    EXPECT_TRUE(simsense::make_vulkan_matcher(device(), pair.width, pair.height, 1, p, summed)->plan().sums_blocks());
    compare(pair, p, summed);
  }
}

TEST(vulkan_matcher, every_pair_of_a_batch_equals_its_own_match) {
  constexpr uint32_t width = 61, height = 43, batch = 5, pixels = width * height;
  MatchParameters p = searching(32);
  constexpr uint64_t offset = 7;  // images need no alignment
  const auto left = ks::Buffer::create(device(), offset + batch * pixels, 0), right = ks::Buffer::create(device(), batch * pixels, 0);
  const auto disparity = ks::Buffer::create(device(), 8 + batch * pixels * 4, 0);
  std::vector<StereoPair> pairs;
  for (uint32_t i = 0; i < batch; ++i) {
    pairs.push_back(random_dots(width, height, 3 * i, 10, i));
    left->write(offset + i * pixels, pairs[i].left.data(), pixels);
    right->write(i * pixels, pairs[i].right.data(), pixels);
  }
  MatchTuning tuning;
  tuning.pairs_at_once = 2;
  const auto matcher = simsense::make_vulkan_matcher(device(), width, height, batch, p, tuning);
  matcher->match({*left, offset}, {*right}, {*disparity, 8});
  std::vector<float> found(batch * pixels);
  disparity->read(8, found.data(), found.size() * 4);
  for (uint32_t i = 0; i < batch; ++i) {
    const float* own = &found[i * pixels];
    const auto expected = match(*simsense::make_reference_matcher(width, height, p), pairs[i]);
    expect_same(expected, std::vector<float>(own, own + pixels), width, "pair " + std::to_string(i));
  }
}

TEST(vulkan_matcher, images_that_leave_their_buffer_are_refused) {
  const auto small = ks::Buffer::create(device(), 64 * 64, 0), large = ks::Buffer::create(device(), 64 * 64 * 4, 0);
  const auto matcher = simsense::make_vulkan_matcher(device(), 64, 64, 1, searching(16));
  EXPECT_THROW(matcher->match({*small, 1}, {*small}, {*large}), ks::Error);
  EXPECT_THROW(matcher->match({*small}, {*small}, {*small}), ks::Error);
  EXPECT_THROW(matcher->match({*small}, {*small}, {*large, 4}), ks::Error);
  matcher->match({*small}, {*small}, {*large});
}

TEST(vulkan_matcher, the_host_device_is_refused) {
  EXPECT_THROW(simsense::make_vulkan_matcher(ks::test::host_device(), 64, 64, 1, MatchParameters{}), ks::Error);
}

}  // namespace
