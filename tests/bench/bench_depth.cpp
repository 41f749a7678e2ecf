// SPDX-License-Identifier: Apache-2.0
// The CPU engine's stages around the matcher: rectification of a pair with lenses, depth, registration to 1920x1080 with splats of several
// sizes, points. Medians of 15 in milliseconds, two threads; the pair is 960x540 random dots.
#include <algorithm>
#include <cstdio>
#include <map>
#include <string>
#include <vector>

#include "device/device.h"
#include "engine/engine.h"
#include "simsense/match/stereo_pair.h"
#include "simsense/rig_samples.h"

namespace {

using namespace simsense_test;
constexpr uint32_t width = 960, height = 540, rgb_width = 1920, rgb_height = 1080;
constexpr int repeats = 15;

simsense::ImageArgument image(const void* host, uint32_t format, uint64_t rows, uint64_t columns) {
  const uint64_t shape[2] = {rows, columns};
  return {nullptr, const_cast<void*>(host), ks_image_desc_packed(format, 2, shape)};
}

/// Two lenses, turned against each other; an RGB camera twice as fine with a lens of its own.
simsense_rig_desc rig_with_lenses() {
  simsense_rig_desc rig = crooked_rig(width, height, 0.7 * width);
  rig.rgb = camera(rgb_width, rgb_height, 0.7 * rgb_width);
  rig.rgb.lens.distortion[0] = 0.05;
  set_pose(rig.left_to_rgb, 0.002, -0.003, 0.001, 0.015, 0, 0);
  return rig;
}

void report(const char* name, const simsense_rig_desc& rig, uint32_t splat_size, const StereoPair& pair, uint32_t output) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_HOST;
  desc.worker_count = 2;
  simsense_parameters p = simsense_parameters_init();
  p.block_width = p.block_height = 1;
  p.splat_size = splat_size;
  simsense::Engine engine(ks::Device::create(desc), rig, p);
  const bool rgb = output == SIMSENSE_OUTPUT_DEPTH_RGB;
  std::vector<float> depth(size_t{rgb_width} * rgb_height);
  simsense::ComputeRequest request;
  request.left = image(pair.left.data(), KS_FORMAT_U8, height, width);
  request.right = image(pair.right.data(), KS_FORMAT_U8, height, width);
  request.outputs.push_back({output, image(depth.data(), KS_FORMAT_F32, rgb ? rgb_height : height, rgb ? rgb_width : width)});
  std::map<std::string, std::vector<double>> times;
  for (int i = 0; i < repeats; ++i) {
    engine.compute(request);
    for (const ks_stage_time& stage : engine.stage_times()) times[stage.name].push_back(stage.milliseconds);
  }
  std::printf("%s\n", name);
  for (const char* stage : {"rectify", "depth", "registration"}) {
    auto found = times.find(stage);
    if (found == times.end()) continue;
    std::sort(found->second.begin(), found->second.end());
    std::printf("    %-14s %6.2f ms, median %6.2f\n", stage, found->second.front(), found->second[repeats / 2]);
  }
}

}  // namespace

int main() {
  const StereoPair pair = random_dots(width, height, 20, 10, 1);
  report("lenses, depth in the left camera", rig_with_lenses(), 1, pair, SIMSENSE_OUTPUT_DEPTH);
  for (const uint32_t size : {1u, 2u, 3u, 7u}) {
    const std::string name = "registered to 1920x1080, splat " + std::to_string(size) + (size == 2 ? " (depth_dilation)" : "");
    report(name.c_str(), rig_with_lenses(), size, pair, SIMSENSE_OUTPUT_DEPTH_RGB);
  }
  return 0;
}
