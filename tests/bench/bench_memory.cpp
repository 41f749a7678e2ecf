// SPDX-License-Identifier: Apache-2.0
// Peak memory and time of the CPU matcher from small images to 3840x2160 with 512 disparities: one first frame each, in a process of its
// own, two threads; what the process had before does not count.
#include <cstdio>
#include <vector>

#include "device/thread_pool.h"
#include "simsense/match/stereo_pair.h"
#include "support/peak_memory.h"

namespace {

void report(uint32_t width, uint32_t height, uint32_t disparities, uint32_t block, uint32_t paths) {
  const StereoPair pair = random_dots(width, height, disparities / 2, 10, 1);
  simsense::MatchParameters p;
  p.max_disparity = disparities;
  p.block_width = p.block_height = block;
  p.path_count = paths;
  std::vector<float> disparity(size_t{width} * height, -1.0f);  // the caller's, and touched: not counted
  const ks_test::Peak peak = ks_test::peak_of([&] {
    ks::ThreadPool workers(2);
    const auto matcher = simsense::make_cpu_matcher(width, height, p, workers);
    matcher->match({pair.left.data(), width}, {pair.right.data(), width}, disparity.data());
  });
  std::printf("| %ux%u | %u | %ux%u | %u | %.0f MB | %.0f ms |%s\n", width, height, disparities, block, block, paths, peak.megabytes,
              peak.milliseconds, peak.ok ? "" : " failed");
  std::fflush(stdout);
}

}  // namespace

int main() {
  std::printf("| image | D | block | paths | peak memory | time of the first frame |\n|--|--|--|--|--|--|\n");
  for (const uint32_t block : {1u, 7u})
    for (const uint32_t paths : {4u, 8u}) report(960, 540, 128, block, paths);
  report(848, 480, 1024, 1, 4);
  for (const uint32_t block : {1u, 7u}) report(3840, 2160, 128, block, 4);
  for (const uint32_t block : {1u, 7u}) report(3840, 2160, 512, block, 4);
  report(3840, 2160, 512, 1, 8);
  return 0;
}
