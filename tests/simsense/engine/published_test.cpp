// SPDX-License-Identifier: Apache-2.0
// The engine with every fault of the published SimSense switched on gives that program's bits, as an independent scalar account of it has
// them; and each switch does what its name says.
#include <gtest/gtest.h>

#include <random>

#include "capi/device/devices.h"
#include "engine/engine.h"
#include "simsense/match/stereo_pair.h"
#include "simsense/reference/published.h"
#include "simsense/rig_samples.h"

using namespace simsense_test;

namespace {

std::vector<float> engine_depth(const simsense_rig_desc& rig, const simsense_parameters& p, const StereoPair& pair) {
  simsense::Engine engine(ks::test::host_device(), rig, p);
  const bool to_rgb = rig.rgb.width != 0;
  const simsense_camera& size = to_rgb ? rig.rgb : rig.left;
  std::vector<float> depth(size_t{size.width} * size.height, -7);
  const auto image = [](const void* host, uint32_t format, uint64_t height, uint64_t width) {
    const uint64_t shape[2] = {height, width};
    return simsense::ImageArgument{nullptr, const_cast<void*>(host), ks_image_desc_packed(format, 2, shape)};
  };
  simsense::ComputeRequest request;
  request.left = image(pair.left.data(), KS_FORMAT_U8, pair.height, pair.width);
  request.right = image(pair.right.data(), KS_FORMAT_U8, pair.height, pair.width);
  request.outputs.push_back(
      {to_rgb ? SIMSENSE_OUTPUT_DEPTH_RGB : SIMSENSE_OUTPUT_DEPTH, image(depth.data(), KS_FORMAT_F32, size.height, size.width)});
  engine.compute(request);
  return depth;
}

/// A rig that needs rectification, without lenses: the published engine has none.
simsense_rig_desc turned_rig(uint32_t width, uint32_t height) {
  simsense_rig_desc rig = crooked_rig(width, height, 0.7 * width);
  for (int i = 0; i < 8; ++i) rig.left.lens.distortion[i] = rig.right.lens.distortion[i] = 0;
  return rig;
}

simsense_rig_desc with_rgb(simsense_rig_desc rig, uint32_t width, uint32_t height) {
  rig.rgb = camera(width, height, 0.7 * width);
  set_pose(rig.left_to_rgb, 0.01, -0.015, 0.02, 0.005, 0.001, 0.03);  // the left camera's centre is in view
  return rig;
}

simsense_parameters published_parameters() {
  simsense_parameters p = simsense_parameters_init();
  p.subpixel = SIMSENSE_SUBPIXEL_PARABOLA;
  p.census_contrast = 0;
  p.max_disparity = 32;
  return p;
}

size_t count_different(const std::vector<float>& a, const std::vector<float>& b) {
  size_t count = 0;
  for (size_t i = 0; i < a.size(); ++i) count += a[i] != b[i];
  return count;
}

TEST(published, every_fault_together_gives_its_bits) {
  std::mt19937 random(3);
  const auto in = [&](uint32_t low, uint32_t high) { return low + random() % (high - low + 1); };
  size_t measured = 0;
  for (int i = 0; i < 24; ++i) {
    const uint32_t width = in(64, 130), height = in(40, 70);
    simsense_parameters p = published_parameters();
    p.max_disparity = in(32, 60);
    p.block_width = 1 + 2 * in(0, 3);
    p.block_height = 1 + 2 * in(0, 3);
    p.census_width = 3 + 2 * in(0, 2);
    p.p2 = in(2, 223);
    p.p1 = in(1, p.p2 - 1);
    p.uniqueness_ratio = in(0, 20);
    p.lr_max_diff = static_cast<int32_t>(in(0, 3)) - 1;
    p.median_size = 1 + 2 * in(0, 3);
    p.depth_dilation = in(0, 1);
    p.min_depth_m = 0.01f * static_cast<float>(in(0, 20));
    simsense_rig_desc rig = turned_rig(width, height);
    rig.rectified = in(0, 1);
    if (in(0, 1)) rig = with_rgb(rig, in(40, 200), in(40, 150));
    rig.faults = SIMSENSE_FAULTS_PUBLISHED;
    const StereoPair pair = random_dots(width, height, in(3, 25), in(0, 15), in(0, 1000));
    const auto expected = simsense::reference::published_depth(rig, p, pair.left, pair.right);
    EXPECT_EQ(count_different(expected, engine_depth(rig, p, pair)), 0u) << "case " << i << " rectified " << rig.rectified;
    measured += static_cast<size_t>(std::count_if(expected.begin(), expected.end(), [](float z) { return z > 0; }));
  }
  EXPECT_GT(measured, 20000u);
}

/// Pixels that two sets of faults tell apart, in a wide and in a narrow view: one shows the rectified image's edges, the other its own.
size_t count_told_apart(uint32_t faults, uint32_t other_faults) {
  const StereoPair pair = random_dots(120, 60, 12, 6, 5);
  simsense_parameters p = published_parameters();
  p.depth_dilation = 1;
  size_t count = 0;
  for (const double rgb_focal : {105.0, 260.0}) {
    simsense_rig_desc rig = with_rgb(turned_rig(120, 60), 150, 90);
    rig.rgb.k[0] = rig.rgb.k[4] = rgb_focal;
    rig.faults = faults;
    const auto depth = engine_depth(rig, p, pair);
    rig.faults = other_faults;
    count += count_different(depth, engine_depth(rig, p, pair));
  }
  return count;
}

// without lenses the rectifier's focal length and baseline are the engine's own: focal_from_rectifier has its own test below
TEST(published, each_fault_changes_depth_may_be_mended_alone_and_is_absent_by_default) {
  for (uint32_t fault = 1; fault <= SIMSENSE_FAULTS_PUBLISHED; fault *= 2) {
    if (fault == SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER) continue;
    EXPECT_GT(count_told_apart(0, fault), 0u) << "fault 0x" << std::hex << fault;
    EXPECT_GT(count_told_apart(SIMSENSE_FAULTS_PUBLISHED, SIMSENSE_FAULTS_PUBLISHED & ~fault), 0u)
        << "all but fault 0x" << std::hex << fault;
  }
}

TEST(published, focal_length_from_the_rectifier_forgets_the_principal_points_of_a_rectified_pair) {
  const StereoPair pair = random_dots(120, 60, 12, 0, 6);
  simsense_rig_desc rig = ideal_rig(120, 60, 84);
  rig.right.k[2] -= 2;  // infinity is at 2 pixels
  simsense_parameters p = published_parameters();
  p.subpixel = SIMSENSE_SUBPIXEL_NONE;
  const auto depth_at_centre = [&] { return engine_depth(rig, p, pair)[30 * 120 + 60]; };
  EXPECT_NEAR(depth_at_centre(), 84 * 0.05f / 10, 1e-5f);
  rig.faults = SIMSENSE_FAULT_FOCAL_FROM_RECTIFIER;
  EXPECT_NEAR(depth_at_centre(), 84 * 0.05f / 12, 0.01f);
}

}  // namespace
