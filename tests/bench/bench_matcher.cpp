// SPDX-License-Identifier: Apache-2.0
// The CPU matcher beside OpenCV's StereoSGBM, MODE_HH4 (the same four paths) and MODE_SGBM_3WAY, on the same pair of random dots with noise
// and the same threads: medians and their ratio. StereoSGBM leaves the columns left of the largest disparity out; the pair is widened for
// it, so that both give every pixel a disparity. `avx2` as argument: without AVX-512.
#include <hwy/targets.h>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "device/thread_pool.h"
#include "match/matcher.h"
#include "matcher_bench.h"

namespace {

constexpr int threads = 2, repeats = 15;

struct Pair {
  cv::Mat left, right;
};

Pair synthetic_pair() {
  const bench::Pair dots = bench::dot_pair(960, 540);
  const auto image = [](const std::vector<uint8_t>& values) { return cv::Mat(values, true).reshape(1, 540); };
  return {image(dots.left), image(dots.right)};
}

/// Wall milliseconds, and processor milliseconds over the number of threads, which a busy machine distorts least.
struct Time {
  double wall_ms, cpu_ms;
};

template <class F>
Time median_time(F&& fn) {
  fn();
  std::vector<double> wall, cpu;
  for (int i = 0; i < repeats; ++i) {
    const auto start = std::chrono::steady_clock::now();
    const std::clock_t cpu_start = std::clock();
    fn();
    cpu.push_back(1e3 * static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC / threads);
    wall.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  return {bench::median(wall), bench::median(cpu)};
}

Time opencv_time(const Pair& pair, int disparities, int block, int mode) {
  cv::Mat left, right, disparity;
  cv::copyMakeBorder(pair.left, left, 0, 0, disparities, 0, cv::BORDER_REPLICATE);
  cv::copyMakeBorder(pair.right, right, 0, 0, disparities, 0, cv::BORDER_REPLICATE);
  const auto sgbm = cv::StereoSGBM::create(0, disparities, block, 8 * block * block, 32 * block * block, 1, 63, 15, 0, 0, mode);
  return median_time([&] { sgbm->compute(left, right, disparity); });
}

struct Ours {
  Time time;
  double valid_percent;
  std::vector<ks_stage_time> stages;
};

Ours measure(const Pair& pair, uint32_t disparities, uint32_t block, ks::ThreadPool& workers) {
  simsense::MatchParameters p;
  p.max_disparity = disparities;
  p.block_width = p.block_height = block;
  const auto matcher = simsense::make_cpu_matcher(static_cast<uint32_t>(pair.left.cols), static_cast<uint32_t>(pair.left.rows), p, workers);
  std::vector<float> disparity(pair.left.total());
  const simsense::ConstImage left{pair.left.data, static_cast<ptrdiff_t>(pair.left.step)};
  const simsense::ConstImage right{pair.right.data, static_cast<ptrdiff_t>(pair.right.step)};
  const Time time = median_time([&] { matcher->match(left, right, disparity.data()); });
  const auto valid = std::count_if(disparity.begin(), disparity.end(), [](float d) { return d >= 0.0f; });
  return {time, 100.0 * static_cast<double>(valid) / static_cast<double>(disparity.size()), matcher->stage_times()};
}

void report(const Pair& pair, uint32_t disparities, uint32_t block, ks::ThreadPool& workers) {
  const auto [ours, valid, stages] = measure(pair, disparities, block, workers);
  const auto opencv = [&](int mode) { return opencv_time(pair, static_cast<int>(disparities), static_cast<int>(block), mode); };
  const Time hh4 = opencv(cv::StereoSGBM::MODE_HH4), three_way = opencv(cv::StereoSGBM::MODE_SGBM_3WAY);
  std::printf(
      "D %3u block %ux%u: simsense %7.2f ms (cpu %7.2f), OpenCV HH4 %7.2f (cpu %7.2f), 3WAY %7.2f (cpu %7.2f): ratios %.1f (cpu %.1f), "
      "%.1f (cpu %.1f); valid %.1f %%\n",
      disparities, block, block, ours.wall_ms, ours.cpu_ms, hh4.wall_ms, hh4.cpu_ms, three_way.wall_ms, three_way.cpu_ms,
      hh4.wall_ms / ours.wall_ms, hh4.cpu_ms / ours.cpu_ms, three_way.wall_ms / ours.wall_ms, three_way.cpu_ms / ours.cpu_ms, valid);
  for (const ks_stage_time& stage : stages) std::printf("    %-24s %7.2f ms\n", stage.name, stage.milliseconds);
}

}  // namespace

int main(int count, char** arguments) {
  if (count > 1 && std::string(arguments[1]) == "avx2") hwy::SetSupportedTargetsForTest(HWY_AVX2);
  cv::setNumThreads(threads);
  ks::ThreadPool workers(threads);
  const Pair pair = synthetic_pair();
  std::printf("random dots, %dx%d, %d threads, census 7x7, 4 paths, median of %d\n", pair.left.cols, pair.left.rows, threads, repeats);
  for (const uint32_t disparities : {64u, 128u, 256u}) report(pair, disparities, 1, workers);
  report(pair, 128, 7, workers);
}
