// SPDX-License-Identifier: Apache-2.0
// What the CPU matcher adds to a process at its highest, a pair of 960x540 and 128 disparities on two threads: no volume is stored,
// which alone would take 66 megabytes.
#include "device/thread_pool.h"
#include "simsense/match/matcher_fuzz.h"
#include "support/peak_memory.h"

namespace {

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
