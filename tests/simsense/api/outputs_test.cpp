// SPDX-License-Identifier: Apache-2.0
// The outputs beside disparity and depth, their integer forms, and the parameters that come with them, through the C API.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "simsense/api/sensor.h"
#include "simsense/rig_samples.h"

using namespace simsense_test;

namespace {

constexpr uint32_t width = 200, height = 120, shift = 14;
constexpr double f = 140;
const std::vector<uint64_t> shape{height, width};

/// A plane at `shift` pixels with a patch that only the left camera sees, a flat patch and a saturated one.
Pair scene() {
  std::mt19937 random(1);
  std::vector<uint8_t> texture((width + shift) * height);
  for (uint8_t& value : texture) value = static_cast<uint8_t>(random() % 200);
  Pair pair{std::vector<uint8_t>(width * height), std::vector<uint8_t>(width * height)};
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) {
      pair.left[y * width + x] = texture[y * (width + shift) + x];
      pair.right[y * width + x] = texture[y * (width + shift) + x + shift];
      const bool patch = y >= 20 && y < 50;
      if (patch && x >= 60 && x < 90) pair.left[y * width + x] = static_cast<uint8_t>(random() % 200);
      if (patch && x >= 110 && x < 140) pair.left[y * width + x] = pair.right[y * width + x - shift] = 90;
      if (patch && x >= 160 && x < 190) pair.left[y * width + x] = pair.right[y * width + x - shift] = 255;
    }
  return pair;
}

simsense_parameters parameters() {
  simsense_parameters p = simsense_parameters_init();
  p.max_disparity = 32;
  p.block_width = p.block_height = 1;
  return p;
}

simsense_rig_desc rig() { return ideal_rig(width, height, f); }

size_t count(const std::vector<uint8_t>& reasons, uint8_t reason) {
  return static_cast<size_t>(std::count(reasons.begin(), reasons.end(), reason));
}

size_t count_in(const std::vector<uint8_t>& reasons, uint8_t reason, uint32_t x0, uint32_t x1) {
  size_t n = 0;
  for (uint32_t y = 26; y < 44; ++y)
    for (uint32_t x = x0 + 6; x < x1 - 6; ++x) n += reasons[y * width + x] == reason;
  return n;
}

TEST(Outputs, ReasonAndConfidenceTellOfEveryPixel) {
  const EngineHandle engine = open_engine(rig(), parameters());
  const Pair pair = scene();
  std::vector<float> depth(width * height), disparity(depth.size()), confidence(depth.size());
  std::vector<uint8_t> reason(depth.size());
  expect_computed(engine, host_image(pair.left, shape), host_image(pair.right, shape),
                  {output_of(SIMSENSE_OUTPUT_DEPTH, host_image(depth, shape)), output_of(SIMSENSE_OUTPUT_REASON, host_image(reason, shape)),
                   output_of(SIMSENSE_OUTPUT_DISPARITY, host_image(disparity, shape)),
                   output_of(SIMSENSE_OUTPUT_CONFIDENCE, host_image(confidence, shape))});
  for (size_t i = 0; i < depth.size(); ++i) {
    ASSERT_EQ(depth[i] > 0, reason[i] == SIMSENSE_REASON_VALID);
    ASSERT_TRUE(confidence[i] >= 0 && confidence[i] <= 1);
    ASSERT_TRUE(disparity[i] >= 0 || confidence[i] == 0);
  }
  EXPECT_GT(count(reason, SIMSENSE_REASON_VALID), width * height * 3 / 4);
  EXPECT_GT(count_in(reason, SIMSENSE_REASON_NOT_UNIQUE, 60, 90) + count_in(reason, SIMSENSE_REASON_OCCLUDED, 60, 90) +
                count_in(reason, SIMSENSE_REASON_ISOLATED, 60, 90),
            60u);
  EXPECT_EQ(count_in(reason, SIMSENSE_REASON_LOW_TEXTURE, 110, 140) + count_in(reason, SIMSENSE_REASON_VALID, 110, 140), 18u * 18u);
  EXPECT_EQ(count_in(reason, SIMSENSE_REASON_SATURATED, 160, 190) + count_in(reason, SIMSENSE_REASON_VALID, 160, 190), 18u * 18u);
  EXPECT_GT(count(reason, SIMSENSE_REASON_OUTSIDE), 50u);
}

TEST(Outputs, WhatLiesBeyondTheRangeIsSaidToBe) {
  simsense_parameters p = parameters();
  p.max_depth_m = 0.3f;  // the plane is at 0.5 m
  const EngineHandle engine = open_engine(rig(), p);
  const Pair pair = scene();
  const auto reason = compute_one<uint8_t>(engine, SIMSENSE_OUTPUT_REASON, pair, height, width, shape);
  EXPECT_EQ(reason[80 * width + 100], SIMSENSE_REASON_OUT_OF_RANGE);
}

TEST(Outputs, IntegerFormsAreTheRoundedFloats) {
  simsense_rig_desc with_rgb = rig();
  with_rgb.rgb = camera(width, height, f);
  const EngineHandle engine = open_engine(with_rgb, parameters());
  const Pair pair = scene();
  const simsense_image left = host_image(pair.left, shape), right = host_image(pair.right, shape);
  const auto disparity = compute_one<float>(engine, SIMSENSE_OUTPUT_DISPARITY, pair, height, width, shape);
  const auto depth = compute_one<float>(engine, SIMSENSE_OUTPUT_DEPTH, pair, height, width, shape);
  const auto depth_rgb = compute_one<float>(engine, SIMSENSE_OUTPUT_DEPTH_RGB, pair, height, width, shape);
  std::vector<int16_t> sixteenths(depth.size()), millimetres(depth.size());
  std::vector<uint16_t> millimetres_rgb(depth.size());
  expect_computed(engine, left, right,
                  {output_of(SIMSENSE_OUTPUT_DISPARITY, host_image(sixteenths, shape, KS_FORMAT_I16)),
                   output_of(SIMSENSE_OUTPUT_DEPTH, host_image(millimetres, shape, KS_FORMAT_I16)),
                   output_of(SIMSENSE_OUTPUT_DEPTH_RGB, host_image(millimetres_rgb, shape, KS_FORMAT_U16))});
  for (size_t i = 0; i < depth.size(); ++i) {
    ASSERT_EQ(sixteenths[i], std::lrint(16 * disparity[i]));
    ASSERT_EQ(millimetres[i], std::lrint(1000 * depth[i]));
    ASSERT_EQ(millimetres_rgb[i], std::lrint(1000 * depth_rgb[i]));
  }
  expect_refused(compute(engine, left, right, {output_of(SIMSENSE_OUTPUT_DEPTH, host_image(millimetres, shape, KS_FORMAT_F16))}), "i16");
}

TEST(Outputs, MillimetresBeyondTheTypeAreNoMeasurement) {
  simsense_rig_desc far = rig();
  far.left_to_right[3] = -5;  // 50 m
  simsense_parameters p = parameters();
  p.max_depth_m = 1000;
  const EngineHandle engine = open_engine(far, p);
  const Pair pair = scene();
  std::vector<int16_t> narrow(width * height, 1);
  std::vector<uint16_t> wide(width * height, 1);
  for (const auto& [image, expected] :
       {std::pair{host_image(narrow, shape, KS_FORMAT_I16), 0}, std::pair{host_image(wide, shape, KS_FORMAT_U16), 50000}}) {
    expect_computed(engine, host_image(pair.left, shape), host_image(pair.right, shape), {output_of(SIMSENSE_OUTPUT_DEPTH, image)});
    EXPECT_NEAR(static_cast<const uint16_t*>(image.host)[80 * width + 100], expected, 500);
  }
}

TEST(Outputs, ColoredPointsAreThePointsAndTheImage) {
  simsense_rig_desc with_rgb = rig();
  with_rgb.rgb = camera(width, height, f);
  const EngineHandle engine = open_engine(with_rgb, parameters());
  const Pair pair = scene();
  std::vector<uint8_t> rgb(width * height * 3);
  for (size_t i = 0; i < rgb.size(); ++i) rgb[i] = static_cast<uint8_t>(i * 7);
  std::vector<float> points(width * height * 3), colored(width * height * 6);
  const std::vector<simsense_output_desc> outputs{output_of(SIMSENSE_OUTPUT_POINTS, host_image(points, {height, width, 3})),
                                                  output_of(SIMSENSE_OUTPUT_POINTS_COLORED, host_image(colored, {height, width, 6}))};
  simsense_compute_desc desc = request(host_image(pair.left, shape), host_image(pair.right, shape), outputs);
  EXPECT_EQ(simsense_engine_compute(engine.get(), &desc), KS_ERROR_INVALID_ARGUMENT) << "without the image";
  desc.rgb = host_image(rgb, {height, width, 3});
  ASSERT_EQ(simsense_engine_compute(engine.get(), &desc), KS_OK) << simsense_last_error();
  size_t measured = 0;
  for (size_t i = 0; i < width * height; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      ASSERT_EQ(colored[6 * i + c], points[3 * i + c]);
      ASSERT_EQ(colored[6 * i + 3 + c], points[3 * i + 2] > 0 ? static_cast<float>(rgb[3 * i + c]) / 255.0f : 0.0f);
    }
    measured += points[3 * i + 2] > 0;
  }
  EXPECT_GT(measured, width * height / 2);
}

TEST(Outputs, RegionOfInterestIsWhatTheWholeImageGivesThere) {
  const Device device = open_device();
  const Pair pair = scene();
  const auto disparities = [&](const simsense_parameters& p) {
    return compute_one<float>(open_engine(device, rig(), p), SIMSENSE_OUTPUT_DISPARITY, pair, height, width, shape);
  };
  simsense_parameters p = parameters();
  const auto whole = disparities(p);
  p.roi_x = 100, p.roi_y = 60, p.roi_width = 50, p.roi_height = 30;
  const auto part = disparities(p);
  size_t same = 0;
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) {
      const bool inside = x >= 100 && x < 150 && y >= 60 && y < 90;
      ASSERT_TRUE(inside || part[y * width + x] == -1.0f);
      if (inside) same += std::abs(part[y * width + x] - whole[y * width + x]) < 0.1f;
    }
  EXPECT_GT(same, 50u * 30u * 99 / 100);
}

TEST(Outputs, SpecklesGoAndHolesFill) {
  const Device device = open_device();
  const Pair pair = scene();
  simsense_parameters p = parameters();
  p.uniqueness_ratio = 0;
  p.lr_max_diff = -1;
  p.median_size = 1;
  const auto run = [&](uint32_t output) { return compute_one<uint8_t>(open_engine(device, rig(), p), output, pair, height, width, shape); };
  const auto invalid = [&] {
    const auto d = compute_one<float>(open_engine(device, rig(), p), SIMSENSE_OUTPUT_DISPARITY, pair, height, width, shape);
    return std::count(d.begin(), d.end(), -1.0f);
  };
  EXPECT_EQ(invalid(), 0);
  p.speckle_max_size = 60;
  EXPECT_GT(count(run(SIMSENSE_OUTPUT_REASON), SIMSENSE_REASON_SPECKLE), 200u);
  EXPECT_GT(invalid(), 200);
  p.hole_filling = SIMSENSE_HOLES_BACKGROUND;
  EXPECT_EQ(invalid(), 0);
}

}  // namespace
