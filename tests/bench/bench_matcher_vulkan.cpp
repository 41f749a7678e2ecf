// The Vulkan matcher, image pairs and disparities in device memory: milliseconds of each stage on the device and of the whole call, per
// pair, at several disparity ranges, blocks and batches; every disparity is compared with the CPU matcher's.
//
//   bench_matcher_vulkan            the defaults of the device
//   bench_matcher_vulkan tune       lanes, steps, workgroups, segments and pairs at once, one varied at a time around the best so far
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "device/buffer.h"
#include "device/error.h"
#include "device/thread_pool.h"
#include "vulkan/vulkan_matcher.h"

namespace {

using simsense::MatchParameters;
using simsense::MatchTuning;

constexpr uint32_t width = 960, height = 540, pixels = width * height;

struct Pair {
  std::vector<uint8_t> left, right;
};

/// Dots on a slanted surface with steps, disparity 5 .. 100, uniform noise.
Pair synthetic_pair() {
  std::mt19937 random(1);
  Pair pair;
  std::vector<int> texture(width + 128);
  for (uint32_t y = 0; y < height; ++y) {
    for (int& value : texture) value = static_cast<int>(random() % 4 == 0 ? 90 + random() % 150 : 20 + random() % 30);
    const auto seen = [&](uint32_t at) {
      return static_cast<uint8_t>(std::clamp(texture[at] + static_cast<int>(random() % 11) - 5, 0, 255));
    };
    for (uint32_t x = 0; x < width; ++x) {
      pair.right.push_back(seen(x + 128));
      pair.left.push_back(seen(x + 128 - (5 + y / 8 + x / 240 * 9)));
    }
  }
  return pair;
}

struct Case {
  MatchParameters parameters;
  uint32_t batch = 1;
};

/// Medians over the runs, milliseconds per pair.
struct Result {
  std::map<std::string, double> stages;
  double device_ms = 0, wall_ms = 0;
  size_t mismatches = 0;
  std::string layout;
};

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

class Bench {
 public:
  explicit Bench(std::shared_ptr<ks::Device> device) : device_(std::move(device)), pair_(synthetic_pair()) {}

  Result run(const Case& c, const MatchTuning& tuning, int repeats) {
    prepare(c);
    const auto matcher = simsense::make_vulkan_matcher(device_, width, height, c.batch, c.parameters, tuning);
    std::map<std::string, std::vector<double>> stages;
    std::vector<double> walls, totals;
    const auto timed_match = [&] {
      const auto start = std::chrono::steady_clock::now();
      matcher->match({*left_}, {*right_}, {*disparity_});
      return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
    };
    for (double warm_ms = 0; warm_ms < 60;) warm_ms += timed_match();  // clocks rise, pipelines compile
    for (int i = 0; i < repeats; ++i) {
      const double wall = timed_match();
      double total = 0;
      for (const ks_stage_time& stage : matcher->stage_times())
        stages[stage.name].push_back(stage.milliseconds), total += stage.milliseconds;
      walls.push_back(wall / c.batch);
      totals.push_back(total / c.batch);
    }
    Result result{{}, median(totals), median(walls), count_mismatches(c), layout(*matcher)};
    for (const auto& [name, times] : stages) result.stages[name] = median(times) / c.batch;
    return result;
  }

 private:
  static std::string layout(const simsense::VulkanMatcher& matcher) {
    const simsense::MatchPlan& p = matcher.plan();
    char text[160];
    std::snprintf(text, sizeof text, "lanes %2ux%-2u steps %u groups %3u,%3u segments %2u pairs %2u %s %4.0f MB", p.path_lanes,
                  p.lane_disparities, p.steps, p.path_group, p.winner_group, p.segments, p.pairs_at_once, p.half_minima ? "half" : "int ",
                  static_cast<double>(matcher.memory_bytes()) * 1e-6);
    return text;
  }

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
    if (!expected_.empty() && c.parameters == parameters_) return;
    parameters_ = c.parameters;
    expected_.resize(pixels);
    simsense::make_cpu_matcher(width, height, c.parameters, device_->workers())
        ->match({pair_.left.data(), width}, {pair_.right.data(), width}, expected_.data());
  }

  size_t count_mismatches(const Case& c) const {
    std::vector<float> found(pixels);
    size_t count = 0;
    for (uint32_t i = 0; i < c.batch; ++i) {
      disparity_->read(uint64_t{i} * pixels * 4, found.data(), pixels * 4);
      for (uint32_t k = 0; k < pixels; ++k) count += std::memcmp(&found[k], &expected_[k], 4) != 0;
    }
    return count;
  }

  std::shared_ptr<ks::Device> device_;
  Pair pair_;
  uint32_t batch_ = 0;
  std::shared_ptr<ks::Buffer> left_, right_, disparity_;
  MatchParameters parameters_;
  std::vector<float> expected_;
};

void print(const Case& c, const Result& r) {
  const auto stage = [&r](const char* name) { return r.stages.contains(name) ? r.stages.at(name) : 0.0; };
  std::printf("| %3u | %u | %2u | %7.4f | %7.4f | %7.4f | %7.4f | %7.4f | %8.4f | %8.4f | %s | %zu |\n", c.parameters.max_disparity,
              c.parameters.block_width, c.batch, stage("census"), stage("block cost"), stage("paths"), stage("winner"),
              stage("check and median"), r.device_ms, r.wall_ms, r.layout.c_str(), r.mismatches);
  std::fflush(stdout);
}

std::vector<Case> cases(bool tuning) {
  std::vector<Case> all;
  for (const uint32_t block : {1u, 7u})
    for (const uint32_t disparities : {128u, 64u, 256u})
      for (const uint32_t batch : {1u, 8u, 32u}) {
        if (tuning && (batch == 8 || (block == 7 && (batch > 1 || disparities != 128)))) continue;
        Case& c = all.emplace_back();
        c.parameters.max_disparity = disparities;
        c.parameters.block_width = c.parameters.block_height = block;
        c.batch = batch;
      }
  return all;
}

/// Varies one setting at a time and keeps what is faster on the device.
void tune(Bench& bench, const Case& c) {
  MatchTuning best;
  double best_ms = 1e30;
  const auto attempt = [&](const MatchTuning& tuning) {
    try {
      const Result result = bench.run(c, tuning, 12);
      print(c, result);
      if (result.device_ms < best_ms) best_ms = result.device_ms, best = tuning;
    } catch (const ks::Error&) {
      // a layout that does not fit these disparities
    }
  };
  attempt(best);
  const auto vary = [&](uint32_t MatchTuning::*setting, std::initializer_list<uint32_t> values) {
    const MatchTuning base = best;
    for (const uint32_t value : values) {
      MatchTuning tuning = base;
      tuning.*setting = value;
      attempt(tuning);
    }
  };
  vary(&MatchTuning::path_lanes, {8, 16, 32});
  vary(&MatchTuning::steps, {8});
  vary(&MatchTuning::path_group, {32, 128, 256});
  vary(&MatchTuning::winner_group, {128, 256});
  vary(&MatchTuning::segments, {1, 2, 4, 8, 12});
  if (c.batch > 1) vary(&MatchTuning::pairs_at_once, {1, 2, 4, 16});
}

}  // namespace

int main(int argc, char** argv) {
  const bool tuning = argc > 1 && std::string(argv[1]) == "tune";
  try {
    const auto device = ks::Device::create(ks_device_desc_init());
    std::printf("%s, %s, subgroup %u; %ux%u, census 7x7, 4 paths; milliseconds per pair, medians\n", device->info().name,
                device->info().driver, device->subgroup_size(), width, height);
    std::printf("| D | block | batch | census | block cost | paths | winner | check, median | device | wall | layout | mismatches |\n");
    std::printf("|--|--|--|--|--|--|--|--|--|--|--|--|\n");
    Bench bench(device);
    for (const Case& c : cases(tuning)) {
      if (tuning)
        tune(bench, c);
      else
        print(c, bench.run(c, {}, device->is_cpu() ? 1 : 50));
    }
  } catch (const ks::Error& error) {
    std::fprintf(stderr, "bench_matcher_vulkan: %s\n", error.what());
    return 1;
  }
  return 0;
}
