// SPDX-License-Identifier: Apache-2.0
#include "device/thread_pool.h"

#include <gtest/gtest.h>

#include <atomic>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

namespace ks {
namespace {

TEST(ThreadPool, VisitsEveryIndexOnce) {
  for (const unsigned workers : {1u, 2u, 3u, 7u}) {
    ThreadPool pool(workers);
    EXPECT_EQ(pool.size(), workers);
    for (const size_t count : {0, 1, 2, 1000}) {
      std::vector<std::atomic<int>> visits(count);
      pool.parallel_for(count, [&](size_t i) { ++visits[i]; });
      for (const auto& visit : visits) ASSERT_EQ(visit, 1);
    }
  }
}

TEST(ThreadPool, ZeroWorkersMeansAsManyAsTheProcessMayUse) { EXPECT_GE(ThreadPool(0).size(), 1u); }

TEST(ThreadPool, RethrowsTheLowestFailureForAnyWorkerCount) {
  for (const unsigned workers : {1u, 2u, 5u}) {
    ThreadPool pool(workers);
    for (int repeat = 0; repeat < 50; ++repeat) {
      std::string text;
      try {
        pool.parallel_for(200, [](size_t i) {
          if (i % 7 == 3) throw std::runtime_error(std::to_string(i));
        });
      } catch (const std::runtime_error& error) {
        text = error.what();
      }
      ASSERT_EQ(text, "3") << workers << " workers";
    }
    // The pool still works afterwards.
    std::atomic<size_t> sum = 0;
    pool.parallel_for(100, [&](size_t i) { sum += i; });
    EXPECT_EQ(sum, 4950u);
  }
}

TEST(ThreadPool, NestedCallsDoNotDeadlock) {
  ThreadPool pool(3);
  std::atomic<int> visits = 0;
  pool.parallel_for(8, [&](size_t) { pool.parallel_for(8, [&](size_t) { ++visits; }); });
  EXPECT_EQ(visits, 64);
}

TEST(ThreadPool, NestedCallsStayInTheirThread) {
  ThreadPool pool(3);
  std::atomic<int> strayed = 0;
  pool.parallel_for(8, [&](size_t) {
    const std::thread::id here = std::this_thread::get_id();
    pool.parallel_for(64, [&](size_t) { strayed += std::this_thread::get_id() != here; });
  });
  EXPECT_EQ(strayed, 0);
}

TEST(ThreadPool, SeveralThreadsMayShareOne) {
  ThreadPool pool(3);
  std::vector<size_t> sums(4, 0);
  std::vector<std::thread> callers;
  for (size_t caller = 0; caller < sums.size(); ++caller)
    callers.emplace_back([&, caller] {
      for (int repeat = 0; repeat < 200; ++repeat) {
        std::vector<size_t> values(50);
        pool.parallel_for(values.size(), [&](size_t i) { values[i] = i; });
        sums[caller] += std::accumulate(values.begin(), values.end(), size_t{0});
      }
    });
  for (std::thread& caller : callers) caller.join();
  for (const size_t sum : sums) EXPECT_EQ(sum, 200u * 1225u);
}

}  // namespace
}  // namespace ks
