// SPDX-License-Identifier: Apache-2.0
// Known geometry through the whole engine: planes come back where they are, from straight and crooked rigs, in both frames.
#include <algorithm>
#include <cmath>

#include "simsense/api/plane_scene.h"
#include "simsense/api/sensor.h"
#include "simsense/rig_samples.h"

using namespace simsense_test;

namespace {

constexpr uint32_t width = 424, height = 240;
constexpr double focal = 427.12;  // of a D435, whose image is twice as large

simsense_parameters near_parameters() {
  simsense_parameters p = simsense_parameters_init();
  p.max_disparity = 64;
  return p;
}

std::vector<float> seen(const EngineHandle& engine, uint32_t output, const Pair& pair) {
  return compute_one<float>(engine, output, pair, height, width, {height, width});
}

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::nth_element(values.begin(), values.begin() + static_cast<ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

struct Agreement {
  double median_error, fill;  // relative error of z; share of pixels that are measured
};

/// Depth of one camera against the plane; camera_k: its K; left_to_camera: its pose.
Agreement agreement(const std::vector<float>& depth, const simsense_camera& camera, const double* left_to_camera, const Plane& plane,
                    uint32_t x_begin = 64) {
  std::vector<double> errors;
  size_t pixels = 0;
  for (uint32_t y = 8; y < camera.height - 8; ++y)
    for (uint32_t x = x_begin; x < camera.width - 8; ++x, ++pixels) {
      const float z = depth[size_t{y} * camera.width + x];
      if (z > 0) errors.push_back(std::abs(z / plane.depth(left_to_camera, ray(camera, x, y)) - 1));
    }
  const double fill = static_cast<double>(errors.size()) / static_cast<double>(pixels);
  return {median(std::move(errors)), fill};
}

simsense_camera rectified_camera(const EngineHandle& engine, double left_to_rectified[16]) {
  simsense_camera c = camera(width, height, focal);
  EXPECT_EQ(simsense_engine_get_rectified(engine.get(), c.k, nullptr, left_to_rectified), KS_OK);
  return c;
}

Plane facing(double z) {
  Plane plane;
  plane.distance_m = z;
  plane.cell_m = 3 * z / focal;
  return plane;
}

Plane tilted(double z, double degrees) {
  Plane plane = facing(z);
  const double angle = degrees * M_PI / 180;
  plane.normal = {std::sin(angle), 0, std::cos(angle)};
  plane.distance_m = z * std::cos(angle);
  return plane;
}

}  // namespace

TEST(Plane, FrontoParallelComesBackAtItsDistance) {
  const simsense_rig_desc rig = ideal_rig(width, height, focal);
  struct Row {
    double z, limit, least_fill;
    simsense_signal signal = simsense_signal_init();
  };
  for (const auto& [z, limit, least_fill, signal] :
       {Row{0.5, 0.005, 0.98}, Row{1.0, 0.005, 0.98}, Row{2.0, 0.01, 0.98}, Row{0.7, 0.005, 0.95, noisy_signal()}}) {
    const EngineHandle engine = open_engine(rig, near_parameters(), signal);
    const Pair pair = photograph(facing(z), rig);
    const auto depth = seen(engine, SIMSENSE_OUTPUT_DEPTH, pair);
    const Agreement a = agreement(depth, rig.left, identity, facing(z));
    RecordProperty("median_error_" + std::to_string(z), std::to_string(a.median_error));
    EXPECT_LT(a.median_error, limit) << "at " << z << " m";
    EXPECT_GT(a.fill, least_fill) << "at " << z << " m";
  }
}

TEST(Plane, TiltedHasNoStairs) {
  const simsense_rig_desc rig = ideal_rig(width, height, focal);
  const Plane plane = tilted(1.0, 40);
  const Pair pair = photograph(plane, rig);
  const EngineHandle engine = open_engine(rig, near_parameters());
  const auto disparity = seen(engine, SIMSENSE_OUTPUT_DISPARITY, pair);
  constexpr size_t bins = 20;
  std::vector<double> residual[bins];  // by fractional part of the true disparity: a stair repeats with period 1
  for (uint32_t y = 8; y < height - 8; ++y)
    for (uint32_t x = 64; x < width - 8; ++x) {
      const double truth = focal * 0.05 / plane.depth(identity, ray(rig.left, x, y)), measured = disparity[y * width + x];
      if (measured >= 0) residual[static_cast<size_t>((truth - std::floor(truth)) * bins)].push_back(measured - truth);
    }
  for (size_t bin = 0; bin < bins; ++bin) {
    EXPECT_GT(residual[bin].size(), 500u);
    EXPECT_LT(std::abs(median(residual[bin])), 0.1) << "fraction " << static_cast<double>(bin) / bins;
  }
}

TEST(Plane, ComesBackFromACrookedRigWithLenses) {
  simsense_rig_desc rig = crooked_rig(width, height, focal);
  const Plane plane = tilted(0.8, 20);
  const Pair pair = photograph(plane, rig);
  const EngineHandle engine = open_engine(rig, near_parameters());
  double left_to_rectified[16];
  const simsense_camera rectified = rectified_camera(engine, left_to_rectified);
  const auto depth = seen(engine, SIMSENSE_OUTPUT_DEPTH, pair);
  const Agreement a = agreement(depth, rectified, left_to_rectified, plane);
  EXPECT_LT(a.median_error, 0.005);
  EXPECT_GT(a.fill, 0.9);
}

TEST(Plane, ComesBackInTheRgbCameraBehindItsLens) {
  simsense_rig_desc rig = crooked_rig(width, height, focal);
  rig.rgb = camera(400, 226, 500);
  const double lens[5] = {0.1, -0.2, 1e-3, -2e-3, 0.05};
  std::copy(lens, lens + 5, rig.rgb.lens.distortion);
  set_pose(rig.left_to_rgb, 0.02, -0.05, 0.03, 0.015, -0.004, 0.006);
  const Plane plane = tilted(0.8, 20);
  const Pair pair = photograph(plane, rig);
  simsense_parameters parameters = near_parameters();
  parameters.depth_dilation = 1;
  const EngineHandle engine = open_engine(rig, parameters);
  const auto depth = compute_one<float>(engine, SIMSENSE_OUTPUT_DEPTH_RGB, pair, height, width, {226, 400});
  const Agreement a = agreement(depth, rig.rgb, rig.left_to_rgb, plane, 100);
  EXPECT_LT(a.median_error, 0.005);
  EXPECT_GT(a.fill, 0.85);
  const auto points = compute_one<float>(engine, SIMSENSE_OUTPUT_POINTS, pair, height, width, {226, 400, 3});
  std::vector<double> distance;  // of each point from the plane
  const cv::Vec3d n = rotation(rig.left_to_rgb) * plane.normal, t = translation(rig.left_to_rgb);
  for (size_t i = 0; i < points.size(); i += 3)
    if (points[i + 2] > 0) distance.push_back(std::abs(n.dot(cv::Vec3d(points[i], points[i + 1], points[i + 2]) - t) - plane.distance_m));
  EXPECT_LT(median(distance), 0.004);
}
