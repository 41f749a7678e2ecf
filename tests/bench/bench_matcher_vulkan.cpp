// SPDX-License-Identifier: Apache-2.0
// The Vulkan matcher, image pairs and disparities in device memory: milliseconds of each stage on the device and of the whole call, per
// pair, and its memory, beside what is asked of an H200; every disparity is compared with the CPU matcher's. Then what registration adds
// to the whole engine.
//
//   bench_matcher_vulkan            the defaults of the device
//   bench_matcher_vulkan TEXT       only cases whose name contains it
//   bench_matcher_vulkan tune [TEXT]  lanes, steps, workgroups, segments and pairs at once, one varied at a time around the best so far
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
#include "engine/engine.h"
#include "signal/imager.h"
#include "vulkan/matcher.h"

namespace {

using simsense::BlockCosts;
using simsense::MatchParameters;
using simsense::MatchTuning;

constexpr uint32_t width = 960, height = 540, pixels = width * height;
constexpr double warm_up_ms = 400;  // a GPU that idled while pipelines were built takes some hundred to raise its clocks

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
  const char* name = "";
  MatchParameters parameters;
  uint32_t batch = 1;
  double asked_ms = 0;  // per pair, on the device
  double asked_mb = 0;
  MatchTuning tuning;
};

/// Medians over the runs, milliseconds per pair.
struct Result {
  std::map<std::string, double> stages;
  double device_ms = 0, wall_ms = 0;
  double memory_mb = 0;
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
    Result result{
        {}, median(totals), median(walls), static_cast<double>(matcher->memory_bytes()) * 1e-6, count_mismatches(c), layout(*matcher)};
    for (const auto& [name, times] : stages) result.stages[name] = median(times) / c.batch;
    return result;
  }

 private:
  static std::string layout(const simsense::VulkanMatcher& matcher) {
    const simsense::MatchPlan& p = matcher.plan();
    char text[160];
    std::snprintf(text, sizeof text, "lanes %2ux%-2u steps %u groups %3u,%3u segments %2u pairs %2u %s %s", p.path_lanes,
                  p.lane_disparities, p.steps, p.path_group, p.winner_group, p.segments, p.pairs_at_once, p.half_minima ? "half" : "int ",
                  p.stored_costs    ? "stored"
                  : p.sums_blocks() ? "summed"
                                    : "");
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
  std::printf("| %s | %.4f | %.4f | %.4f | %.4f | %.4f | %s | %.4f | %s | %s | %zu |\n", c.name, stage("census"), stage("cost"),
              stage("sgm"), stage("winner"), stage("checks"), beside(r.device_ms, c.asked_ms, "%.3f").c_str(), r.wall_ms,
              beside(r.memory_mb, c.asked_mb, "%.0f").c_str(), r.layout.c_str(), r.mismatches);
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
  add("D 128", 128, 1, 1, 0.42, 150);
  add("D 128, census without contrast", 128, 1, 1, 0.42, 150).parameters.census_contrast_256ths = 0;
  add("D 64", 64, 1, 1, 0.30, 0);
  add("D 256", 256, 1, 1, 0.70, 0);
  add("D 128, block 7x7", 128, 7, 1, 0.80, 150);
  add("D 128, block 7x7, stored costs", 128, 7, 1, 0.80, 0).tuning.block_costs = BlockCosts::stored;
  add("D 128, block 7x7, summed costs", 128, 7, 1, 0.80, 150).tuning.block_costs = BlockCosts::summed;
  add("D 128, 8 paths", 128, 1, 1, 0.80, 0).parameters.path_count = 8;
  add("D 128, 8 paths, block 7x7", 128, 7, 1, 0, 0).parameters.path_count = 8;
  add("D 128, batch 8", 128, 1, 8, 0, 0);
  add("D 128, batch 32", 128, 1, 32, 0.21, 0);
  add("D 64, batch 32", 64, 1, 32, 0, 0);
  add("D 256, batch 32", 256, 1, 32, 0, 0);
  add("D 128, block 7x7, batch 32, stored costs", 128, 7, 32, 0, 0).tuning.block_costs = BlockCosts::stored;
  add("D 128, block 7x7, batch 32, summed costs", 128, 7, 32, 0, 0).tuning.block_costs = BlockCosts::summed;
  return all;
}

/// Device memory for the engine's images.
simsense::ImageArgument image_on(const std::shared_ptr<ks::Device>& device, uint32_t format, uint64_t w, uint64_t h) {
  const uint64_t shape[2] = {h, w};
  simsense::ImageArgument image;
  image.image = ks_image_desc_packed(format, 2, shape);
  image.buffer = ks::Buffer::create(device, w * h * ks_format_bytes(format), 0);
  return image;
}

simsense_camera pinhole(uint32_t w, uint32_t h, double f) {
  simsense_camera camera{};
  camera.width = w;
  camera.height = h;
  const double k[9] = {f, 0, 0.5 * w, 0, f, 0.5 * h, 0, 0, 1};
  std::copy(k, k + 9, camera.k);
  return camera;
}

/// The whole engine: noisy imagers, matcher without block, depth and its registration to 1920x1080 with dilation.
void run_engine(const std::shared_ptr<ks::Device>& device) {
  simsense_rig_desc rig = simsense_rig_desc_init();
  rig.left = rig.right = pinhole(width, height, 640);
  rig.rgb = pinhole(1920, 1080, 1380);
  rig.left_to_right[3] = -0.05;
  rig.left_to_rgb[3] = 0.015;
  rig.rectified = 1;
  rig.back_end = SIMSENSE_BACK_END_VULKAN;
  simsense_parameters p = simsense_parameters_init();
  p.block_width = p.block_height = 1;
  p.depth_dilation = 1;
  simsense::Engine engine(device, rig, p);
  engine.set_signal(simsense::signal_preset("d435"), simsense::signal_preset("d435"));
  const Pair pair = synthetic_pair();
  simsense::ComputeRequest request;
  request.left = image_on(device, KS_FORMAT_U8, width, height);
  request.right = image_on(device, KS_FORMAT_U8, width, height);
  request.left.buffer->write(0, pair.left.data(), pixels);
  request.right.buffer->write(0, pair.right.data(), pixels);
  request.outputs = {{SIMSENSE_OUTPUT_DEPTH, image_on(device, KS_FORMAT_F32, width, height)},
                     {SIMSENSE_OUTPUT_DEPTH_RGB, image_on(device, KS_FORMAT_F32, 1920, 1080)}};
  const int repeats = device->is_cpu() ? 1 : 50;
  std::map<std::string, std::vector<double>> stages;
  std::vector<double> walls;
  for (int i = -repeats; i < repeats; ++i) {  // as many to warm up
    const auto start = std::chrono::steady_clock::now();
    engine.compute(request);
    if (i < 0) continue;
    walls.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    for (const ks_stage_time& stage : engine.stage_times()) stages[stage.name].push_back(stage.milliseconds);
  }
  std::printf("\n| stage of the engine, one pair | ms |\n|--|--|\n");
  for (const auto& [name, times] : stages)
    std::printf("| %s | %s |\n", name.c_str(), beside(median(times), name == "registration" ? 0.05 : 0, "%.4f").c_str());
  std::printf("| call | %.4f |\n", median(walls));
}

/// Varies one setting at a time and keeps what is faster on the device.
void tune(Bench& bench, const Case& c) {
  MatchTuning best = c.tuning;
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
  vary(&MatchTuning::path_lanes, {4, 8, 16, 32});
  vary(&MatchTuning::steps, {4, 8});
  vary(&MatchTuning::path_group, {32, 64, 128, 256});
  vary(&MatchTuning::winner_group, {32, 64, 128, 256});
  vary(&MatchTuning::segments, {2, 4, 8, 12, 24, 32});
  if (c.batch > 1) vary(&MatchTuning::pairs_at_once, {1, 4, 16});
}

}  // namespace

int main(int argc, char** argv) {
  const bool tuning = argc > 1 && std::strcmp(argv[1], "tune") == 0;
  const std::string argument = tuning ? (argc > 2 ? argv[2] : "") : argc > 1 ? argv[1] : "";
  try {
    const auto device = ks::Device::create(ks_device_desc_init());
    std::printf("%s, %s, subgroup %u; %ux%u, census 7x7; milliseconds per pair, medians, <= or > what is asked of an H200\n",
                device->info().name, device->info().driver, device->subgroup_size(), width, height);
    std::printf("| case | census | block cost | paths | winner | check, median | device | wall | MB | layout | mismatches |\n");
    std::printf("|--|--|--|--|--|--|--|--|--|--|--|\n");
    Bench bench(device);
    for (const Case& c : cases()) {
      if (std::string(c.name).find(argument) == std::string::npos) continue;
      if (tuning) {
        tune(bench, c);
      } else {
        print(c, bench.run(c, c.tuning, device->is_cpu() ? 1 : 50));
      }
    }
    if (!tuning && (argument.empty() || argument == "engine")) run_engine(device);
  } catch (const ks::Error& error) {
    std::fprintf(stderr, "bench_matcher_vulkan: %s\n", error.what());
    return 1;
  }
  return 0;
}
