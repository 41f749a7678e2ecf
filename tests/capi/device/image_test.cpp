// SPDX-License-Identifier: Apache-2.0
// Views of images in buffers, and worker threads.
#include <gtest/gtest.h>

#include <atomic>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <thread>
#include <vector>

#include "capi/device/expect_error.h"
#include "device/buffer.h"
#include "device/thread_pool.h"
#include "ks/image.h"

namespace ks {
namespace {

ks_image_desc packed(std::initializer_list<uint64_t> shape, uint32_t format = KS_FORMAT_U8) {
  return ks_image_desc_packed(format, static_cast<uint32_t>(shape.size()), shape.begin());
}

TEST(CheckImage, PackedViewTouchesExactlyItsBytes) {
  const ByteRange range = check_image(packed({2, 3, 5}, KS_FORMAT_F32), 120, "image");
  EXPECT_EQ(range.begin, 0u);
  EXPECT_EQ(range.end, 120u);
  EXPECT_ERROR(check_image(packed({2, 3, 5}, KS_FORMAT_F32), 119, "left image"), KS_ERROR_INVALID_ARGUMENT, "left image");
}

TEST(CheckImage, NegativeStrideReachesBelowTheOffset) {
  ks_image_desc flipped = packed({4, 10});
  flipped.byte_stride[0] = -10;
  flipped.offset_bytes = 30;
  const ByteRange range = check_image(flipped, 40, "image");
  EXPECT_EQ(range.begin, 0u);
  EXPECT_EQ(range.end, 40u);
  flipped.offset_bytes = 29;
  EXPECT_ERROR(check_image(flipped, 40, "image"), KS_ERROR_INVALID_ARGUMENT, "leaves");
  flipped.offset_bytes = 31;
  EXPECT_ERROR(check_image(flipped, 40, "image"), KS_ERROR_INVALID_ARGUMENT, "leaves");
}

TEST(CheckImage, RangeHoldsEveryElementOfRandomViews) {
  uint64_t state = 1;
  const auto draw = [&state](uint64_t below) {
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (state >> 33) % below;
  };
  int inside = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    ks_image_desc view = packed({1 + draw(4), 1 + draw(4), 1 + draw(4)});
    for (int k = 0; k < 3; ++k) view.byte_stride[k] = static_cast<int64_t>(1 + draw(12)) * (draw(2) ? 1 : -1);
    view.offset_bytes = draw(80);
    int64_t low = std::numeric_limits<int64_t>::max(), high = std::numeric_limits<int64_t>::min();
    for (uint64_t a = 0; a < view.shape[0]; ++a)
      for (uint64_t b = 0; b < view.shape[1]; ++b)
        for (uint64_t c = 0; c < view.shape[2]; ++c) {
          const int64_t at =
              static_cast<int64_t>(view.offset_bytes + a * view.byte_stride[0] + b * view.byte_stride[1] + c * view.byte_stride[2]);
          low = std::min(low, at);
          high = std::max(high, at + 1);
        }
    if (low >= 0 && high <= 100) {
      const ByteRange range = check_image(view, 100, "image");
      EXPECT_EQ(range.begin, static_cast<uint64_t>(low));
      EXPECT_EQ(range.end, static_cast<uint64_t>(high));
      ++inside;
    } else {
      EXPECT_ERROR(check_image(view, 100, "image"), KS_ERROR_INVALID_ARGUMENT, "leaves");
    }
  }
  EXPECT_GT(inside, 200);
}

TEST(CheckImage, SizesThatOverflow64BitsAreRefused) {
  constexpr uint64_t huge = std::numeric_limits<uint64_t>::max();
  constexpr int64_t far = std::numeric_limits<int64_t>::max();
  ks_image_desc wraps = packed({1ull << 32, 1ull << 32, 4});  // 2^66 bytes: 0 modulo 2^64
  EXPECT_ERROR(check_image(wraps, 16, "image"), KS_ERROR_INVALID_ARGUMENT, "");
  ks_image_desc five = packed({2, 2, 2, 2, 2});
  for (int k = 0; k < 5; ++k) {
    five.shape[k] = huge;
    five.byte_stride[k] = k % 2 ? far : std::numeric_limits<int64_t>::min();
  }
  EXPECT_ERROR(check_image(five, huge, "image"), KS_ERROR_INVALID_ARGUMENT, "leaves");
  ks_image_desc late = packed({8});
  late.offset_bytes = huge - 3;  // offset + 8 wraps to 4
  EXPECT_ERROR(check_image(late, 16, "image"), KS_ERROR_INVALID_ARGUMENT, "leaves");
}

TEST(CheckImage, MalformedViewsAreRefused) {
  ks_image_desc image = packed({4, 4}, KS_FORMAT_F32);
  image.format = 99;
  EXPECT_ERROR(check_image(image, 1000, "image"), KS_ERROR_INVALID_ARGUMENT, "format 99");
  image = packed({4, 4}, KS_FORMAT_F32);
  image.dim_count = 6;
  EXPECT_ERROR(check_image(image, 1000, "image"), KS_ERROR_INVALID_ARGUMENT, "dim_count");
  image.dim_count = 0;
  EXPECT_ERROR(check_image(image, 1000, "image"), KS_ERROR_INVALID_ARGUMENT, "dim_count");
  image = packed({4, 0}, KS_FORMAT_F32);
  EXPECT_ERROR(check_image(image, 1000, "image"), KS_ERROR_INVALID_ARGUMENT, "shape[1] is 0");
  image = packed({4, 4}, KS_FORMAT_F32);
  image.byte_stride[0] = 0;
  EXPECT_ERROR(check_image(image, 1000, "image"), KS_ERROR_INVALID_ARGUMENT, "byte_stride[0] is 0");
  image = packed({4, 4}, KS_FORMAT_F32);
  image.offset_bytes = 2;
  EXPECT_ERROR(check_image(image, 1000, "image"), KS_ERROR_INVALID_ARGUMENT, "multiples of the element's 4 bytes");
}

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
