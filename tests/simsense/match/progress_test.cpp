// SPDX-License-Identifier: Apache-2.0
// A match tells how far it is, rising, on the thread that called it, and can be stopped in its midst; what follows is not harmed by that.
#include <stdexcept>
#include <thread>

#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"

namespace {

using namespace simsense_test;

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
