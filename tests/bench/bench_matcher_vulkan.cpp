// SPDX-License-Identifier: Apache-2.0
// The Vulkan matcher, image pairs and disparities in device memory: milliseconds of each stage on the device and of the whole call, per
// pair, and its memory, beside what is asked of an H200.
// Usage: bench_matcher_vulkan [TEXT]   only cases whose name contains it
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "device/buffer.h"
#include "device/error.h"
#include "device/thread_pool.h"
#include "matcher_bench.h"
#include "vulkan/matcher.h"

namespace {

using simsense::MatchParameters;

constexpr uint32_t width = 960, height = 540, pixels = width * height;
constexpr double warm_up_ms = 400;  // a GPU that idled while pipelines were built takes some hundred to raise its clocks

struct Case {
  const char* name = "";
  MatchParameters parameters;
  uint32_t batch = 1;
  double asked_ms = 0;  // per pair, on the device
  double asked_mb = 0;
};

/// Medians over the runs, milliseconds per pair.
struct Result {
  std::map<std::string, double> stages;
  double device_ms = 0, wall_ms = 0;
  double memory_mb = 0;
};

class Bench {
 public:
  explicit Bench(std::shared_ptr<ks::Device> device) : device_(std::move(device)), pair_(bench::dot_pair(width, height)) {}

  Result run(const Case& c, int repeats) {
    prepare(c);
    const auto matcher = simsense::make_vulkan_matcher(device_, width, height, c.batch, c.parameters);
    std::map<std::string, std::vector<double>> stages;
    std::vector<double> walls, totals;
    const auto timed_match = [&] {
      const auto start = std::chrono::steady_clock::now();
      matcher->match({*left_}, {*right_}, {*disparity_});
      return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    };
    timed_match();
    for (double warm_ms = 0; warm_ms < warm_up_ms;) warm_ms += timed_match();
    for (int i = 0; i < repeats; ++i) {
      const double wall = timed_match();
      double total = 0;
      for (const ks_stage_time& stage : matcher->stage_times())
        stages[stage.name].push_back(stage.milliseconds), total += stage.milliseconds;
      walls.push_back(wall / c.batch);
      totals.push_back(total / c.batch);
    }
    Result result{{}, bench::median(totals), bench::median(walls), static_cast<double>(matcher->memory_bytes()) * 1e-6};
    for (const auto& [name, times] : stages) result.stages[name] = bench::median(times) / c.batch;
    return result;
  }

 private:
  void prepare(const Case& c) {
    if (c.batch > batch_) {
      batch_ = c.batch;
      left_ = ks::Buffer::create(device_, uint64_t{pixels} * batch_, 0);
      right_ = ks::Buffer::create(device_, uint64_t{pixels} * batch_, 0);
      disparity_ = ks::Buffer::create(device_, uint64_t{pixels} * batch_ * 4, 0);
      for (uint32_t i = 0; i < batch_; ++i) {
        left_->write(uint64_t{i} * pixels, pair_.left.data(), pixels);
        right_->write(uint64_t{i} * pixels, pair_.right.data(), pixels);
      }
    }
  }

  std::shared_ptr<ks::Device> device_;
  bench::Pair pair_;
  uint32_t batch_ = 0;
  std::shared_ptr<ks::Buffer> left_, right_, disparity_;
};

/// A figure beside what is asked, if anything is.
std::string beside(double figure, double asked, const char* format) {
  char text[64];
  std::snprintf(text, sizeof text, format, figure);
  std::string out = text;
  if (asked > 0) {
    std::snprintf(text, sizeof text, format, asked);
    out += std::string(figure <= asked ? " <= " : " > ") + text;
  }
  return out;
}

void print(const Case& c, const Result& r) {
  const auto stage = [&r](const char* name) { return r.stages.contains(name) ? r.stages.at(name) : 0.0; };
  std::printf("| %s | %.4f | %.4f | %.4f | %.4f | %.4f | %s | %.4f | %s |\n", c.name, stage("census"), stage("cost"), stage("sgm"),
              stage("winner"), stage("checks"), beside(r.device_ms, c.asked_ms, "%.3f").c_str(), r.wall_ms,
              beside(r.memory_mb, c.asked_mb, "%.0f").c_str());
  std::fflush(stdout);
}

std::vector<Case> cases() {
  std::vector<Case> all;
  const auto add = [&](const char* name, uint32_t disparities, uint32_t block, uint32_t batch, double asked_ms, double asked_mb) -> Case& {
    Case& c = all.emplace_back();
    c.name = name;
    c.parameters.max_disparity = disparities;
    c.parameters.block_width = c.parameters.block_height = block;
    c.batch = batch;
    c.asked_ms = asked_ms;
    c.asked_mb = asked_mb;
    return c;
  };
  add("D 64", 64, 1, 1, 0.30, 0);
  add("D 128", 128, 1, 1, 0.42, 150);
  add("D 256", 256, 1, 1, 0.70, 0);
  add("D 128, block 7x7", 128, 7, 1, 0.80, 150);
  add("D 128, 8 paths", 128, 1, 1, 0.80, 0).parameters.path_count = 8;
  add("D 128, 32 pairs", 128, 1, 32, 0.21, 0);
  return all;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string part = argc > 1 ? argv[1] : "";
  try {
    const auto device = ks::Device::create(ks_device_desc_init());
    std::printf("%s, %s, subgroup %u; %ux%u, census 7x7; milliseconds per pair, medians, <= or > what is asked of an H200\n",
                device->info().name, device->info().driver, device->subgroup_size(), width, height);
    std::printf("| case | census | block cost | paths | winner | check, median | device | wall | MB |\n");
    std::printf("|--|--|--|--|--|--|--|--|--|\n");
    Bench bench(device);
    for (const Case& c : cases())
      if (std::string(c.name).find(part) != std::string::npos) print(c, bench.run(c, device->is_cpu() ? 1 : 50));
  } catch (const ks::Error& error) {
    std::fprintf(stderr, "bench_matcher_vulkan: %s\n", error.what());
    return 1;
  }
  return 0;
}
