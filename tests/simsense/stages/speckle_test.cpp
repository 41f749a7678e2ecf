// Laws of speckle (Goodman, Speckle Phenomena in Optics): contrast, what averaging leaves of it, its correlation in time and space.
#include <gtest/gtest.h>

#include "simsense/stages/signal_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

simsense_signal speckled(float shape, float correlation = 0) {
  simsense_signal s = fine_signal(1, 0);
  s.speckle_shape = shape;
  s.speckle_scale = 1 / shape;
  s.speckle_correlation = correlation;
  return s;
}

double contrast(const std::vector<double>& counts) {
  const Moments m = moments(counts);
  return std::sqrt(m.variance) / m.mean;
}

constexpr float light = 2000;  // of 65535: the brightest grain of shape 1 in a field is about 13 times the mean

std::vector<std::vector<double>> frames(const simsense_signal& signal, uint64_t count) {
  std::vector<std::vector<double>> all;
  for (uint64_t frame = 0; frame < count; ++frame) all.push_back(flat(signal, light, {1, frame}));
  return all;
}

/// Correlation of a field with itself, moved.
double moved_correlation(const std::vector<double>& field, uint32_t dx, uint32_t dy) {
  std::vector<double> here, there;
  for (uint32_t y = 0; y + dy < field_height; ++y)
    for (uint32_t x = 0; x + dx < field_width; ++x) {
      here.push_back(field[size_t{y} * field_width + x]);
      there.push_back(field[size_t{y + dy} * field_width + x + dx]);
    }
  return correlation(here, there);
}

}  // namespace

class SpeckleContrast : public testing::TestWithParam<float> {};

TEST_P(SpeckleContrast, IsOneOverTheRootOfTheShapeHoweverStatic) {
  const double shape = GetParam(), excess = 6 / shape;
  for (const float correlation : {0.0f, 0.3f, 1.0f}) {
    const Moments m = moments(flat(speckled(GetParam(), correlation), light));
    EXPECT_NEAR(m.mean / light, 1, 5 / std::sqrt(shape * field_pixels)) << correlation;
    EXPECT_NEAR(m.variance * shape / (light * light), 1, 5 * std::sqrt((2 + excess) / field_pixels) + shape / (12 * light * light))
        << correlation;
    EXPECT_NEAR(m.skewness, 2 / std::sqrt(shape), 0.02 + 0.03 * 2 / std::sqrt(shape)) << correlation;
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, SpeckleContrast, testing::Values(1.0f, 3.98f, 100.0f, 1333.33f));

TEST(SpeckleInTime, StaticDoesNotAverageOutAndTemporalDoes) {
  constexpr double count = 16;
  for (const float correlation : {0.0f, 0.25f, 1.0f}) {
    const double left = contrast(mean_of(frames(speckled(4, correlation), 16)));
    EXPECT_NEAR(left, 0.5 * std::sqrt(correlation + (1 - correlation) / count), 0.005) << correlation;
  }
}

TEST(SpeckleInTime, FramesOfASceneCorrelateAsToldAtEveryLag) {
  for (const float rho : {0.0f, 0.35f, 0.8f}) {
    const auto first = flat(speckled(4, rho), light, {1, 0});
    for (const uint64_t lag : {1u, 2u, 50u})
      EXPECT_NEAR(correlation(first, flat(speckled(4, rho), light, {1, lag})), rho, 2 * correlation_limit) << lag;
    EXPECT_LT(std::abs(correlation(first, flat(speckled(4, rho), light, {1, 1, 1}))), correlation_limit) << "another scene";
    EXPECT_LT(std::abs(correlation(first, flat(speckled(4, rho), light, {1, 0, 0, 0, 1}))), correlation_limit) << "the other eye";
  }
  EXPECT_EQ(flat(speckled(4, 1), light, {1, 0}), flat(speckled(4, 1), light, {1, 7}));
}

TEST(SpeckleInSpace, IsWhiteWithoutAPsf) {
  const auto field = flat(speckled(4), light);
  for (const auto& [dx, dy] : {std::pair{1u, 0u}, {0u, 1u}, {1u, 1u}, {4u, 0u}})
    EXPECT_LT(std::abs(moved_correlation(field, dx, dy)), 1.1 * correlation_limit) << dx << ", " << dy;
}

TEST(SpeckleInSpace, GrainsHaveThePsfsAutocorrelationAndTheGammaLaw) {
  simsense_signal s = speckled(200);  // nearly normal, so that the factor correlates as its normal does
  s.speckle_psf_sigma_px = 1.5f;
  const auto field = flat(s, light);
  const double independent = field_pixels / (4 * M_PI * 1.5 * 1.5), error = 5 / std::sqrt(independent);
  for (const auto& [dx, dy] : {std::pair{1u, 0u}, {0u, 1u}, {2u, 0u}, {0u, 3u}, {2u, 2u}}) {
    const double squared = dx * dx + dy * dy;
    EXPECT_NEAR(moved_correlation(field, dx, dy), std::exp(-squared / (4 * 1.5 * 1.5)), error) << dx << ", " << dy;
  }
  EXPECT_NEAR(contrast(field) * std::sqrt(200), 1, error);
  simsense_signal strong = speckled(2, 0.5f);
  strong.speckle_psf_sigma_px = 1.5f;
  const Moments m = moments(flat(strong, light));
  EXPECT_NEAR(std::sqrt(m.variance) / m.mean * std::sqrt(2), 1, 2 * error);
  EXPECT_NEAR(m.skewness, 2 / std::sqrt(2), 0.2);
}

TEST(SpeckleInSpace, GrainsDoNotEndAtTheBorder) {
  simsense_signal s = speckled(4);
  s.speckle_psf_sigma_px = 2;
  double sum = 0, squares = 0, count = 0;
  for (uint64_t frame = 0; frame < 12; ++frame) {
    const auto field = flat(s, light, {1, frame});
    for (uint32_t x = 0; x < field_width; ++x) sum += field[x], squares += field[x] * field[x], ++count;
    for (uint32_t y = 0; y < field_height; ++y) {
      const double value = field[size_t{y} * field_width];
      sum += value, squares += value * value, ++count;
    }
  }
  const double mean = sum / count, deviation = std::sqrt(squares / count - mean * mean);
  EXPECT_NEAR(mean / light, 1, 0.06);
  EXPECT_NEAR(deviation / mean, 0.5, 0.05);
}
