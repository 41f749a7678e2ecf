// SPDX-License-Identifier: Apache-2.0
// Laws of the imager's electronic stages, each against its closed form. Errors are five standard errors of the estimate.
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "signal/imager.h"
#include "simsense/signal/signal_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

constexpr float light_e = 3000;

double relative_error_of_variance(double excess_kurtosis = 0) { return 5 * std::sqrt((2 + excess_kurtosis) / field_pixels); }

double mean_of_field(const std::vector<double>& counts) { return std::accumulate(counts.begin(), counts.end(), 0.0) / field_pixels; }

/// Values spread evenly from `low` on over `range`, in no order.
std::vector<float> spread_over(double low, double range) {
  std::vector<float> image(static_cast<size_t>(field_pixels));
  for (size_t i = 0; i < image.size(); ++i)
    image[i] = static_cast<float>(low + std::fmod(static_cast<double>(i) * 0.6180339887, 1.0) * range);
  return image;
}

/// Counts less the light that they are of.
Moments errors_of(const simsense_signal& signal, const std::vector<float>& light) {
  std::vector<double> errors = measure(signal, {}, light);
  for (size_t i = 0; i < light.size(); ++i) errors[i] -= double{light[i]};
  return moments(errors);
}

/// Standard deviations of the means of rows and of columns.
std::pair<double, double> line_deviations(const std::vector<double>& counts) {
  std::vector<double> rows(field_height), columns(field_width);
  for (size_t i = 0; i < counts.size(); ++i) {
    rows[i / field_width] += counts[i] / field_width;
    columns[i % field_width] += counts[i] / field_height;
  }
  return {std::sqrt(moments(rows).variance), std::sqrt(moments(columns).variance)};
}

struct Sigma {
  const char* name;
  float simsense_signal::*field;
  bool is_fixed;

  /// Two frames have the same noise, or noise that is not correlated.
  void expect_kind(const std::vector<double>& first, const std::vector<double>& second, double limit) const {
    EXPECT_EQ(first == second, is_fixed);
    EXPECT_TRUE(is_fixed || std::abs(correlation(first, second)) < limit);
  }
};

/// Counts of one bright spot, a rectangle of `value`, on a field of `light`.
std::vector<double> spot(const simsense_signal& signal, float light, float value, uint32_t width, uint32_t height) {
  std::vector<float> image(static_cast<size_t>(field_pixels), light);
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) image[size_t{200 + y} * field_width + 100 + x] = value;
  return measure(signal, {}, image);
}

}  // namespace

class ShotNoise : public testing::TestWithParam<float> {};

TEST_P(ShotNoise, HasThePoissonLaw) {
  const double mean = GetParam();
  simsense_signal s = fine_signal(1, 0);
  s.shot_noise = 1;
  const auto counts = flat(s, GetParam());
  const Moments m = moments(counts);
  EXPECT_NEAR(m.mean, mean, 5 * std::sqrt(mean / field_pixels));
  EXPECT_NEAR(m.variance / mean, 1, relative_error_of_variance(1 / mean));
  EXPECT_NEAR(m.skewness, 1 / std::sqrt(mean), 5 * std::sqrt((6 + 20 / mean) / field_pixels) + 0.01 / mean);
  for (const double n : {std::floor(mean), std::floor(mean) + 2}) {
    const double expected = std::exp(n * std::log(mean) - mean - std::lgamma(n + 1));
    const double seen = static_cast<double>(std::count(counts.begin(), counts.end(), n)) / field_pixels;
    EXPECT_NEAR(seen, expected, 5 * std::sqrt(expected / field_pixels)) << n << " electrons";
  }
}

INSTANTIATE_TEST_SUITE_P(Means, ShotNoise, testing::Values(0.2f, 1.0f, 4.5f, 9.9f, 10.1f, 40.0f, 1000.0f, 40000.0f));

TEST(ShotNoiseAmount, ScalesTheDeviation) {
  simsense_signal s = fine_signal(1, 0);
  for (const float amount : {0.5f, 3.0f}) {
    s.shot_noise = amount;
    const double variance = amount * amount * light_e;
    EXPECT_NEAR(moments(flat(s, light_e)).variance, variance + 1.0 / 12, variance * relative_error_of_variance());
  }
}

class ReadoutNoise : public testing::TestWithParam<Sigma> {};

TEST_P(ReadoutNoise, HasItsDeviationAndIsFixedOrTemporal) {
  simsense_signal s = fine_signal(20);
  s.*GetParam().field = 4;
  const auto first = flat(s, 100, {1, 0}), second = flat(s, 100, {1, 1}), other_sensor = flat(s, 100, {2, 0});
  const double unit = GetParam().field == &simsense_signal::adc_noise_dn ? 1 : 20;
  const Moments m = moments(first);
  EXPECT_NEAR(m.mean, 100 * 20 + 1000, 5 * 4 * unit / std::sqrt(field_pixels) + 0.01);
  EXPECT_NEAR(std::sqrt(m.variance - 1.0 / 12), 4 * unit, 4 * unit * relative_error_of_variance() / 2);
  EXPECT_LT(std::abs(correlation(first, other_sensor)), correlation_limit);
  GetParam().expect_kind(first, second, correlation_limit);
}

INSTANTIATE_TEST_SUITE_P(Stages, ReadoutNoise,
                         testing::Values(Sigma{"dsnu_e", &simsense_signal::dsnu_e, true},
                                         Sigma{"read_noise_e", &simsense_signal::read_noise_e, false},
                                         Sigma{"adc_noise_dn", &simsense_signal::adc_noise_dn, false}),
                         [](const auto& info) { return std::string(info.param.name); });

class LineNoise : public testing::TestWithParam<std::pair<Sigma, bool>> {};

TEST_P(LineNoise, IsSharedByWholeLinesAndFixedOrTemporal) {
  const auto& [sigma, is_row] = GetParam();
  simsense_signal s = fine_signal(20);
  s.*sigma.field = 4;
  const auto first = flat(s, 100, {1, 0}), second = flat(s, 100, {1, 1});
  const auto [rows, columns] = line_deviations(first);
  const double lines = is_row ? field_height : field_width;
  EXPECT_NEAR(is_row ? rows : columns, 80, 5 * 80 / std::sqrt(2 * lines));
  EXPECT_LT(is_row ? columns : rows, 1e-6) << "across the lines nothing changes";
  sigma.expect_kind(first, second, 5 / std::sqrt(lines));
}

INSTANTIATE_TEST_SUITE_P(Stages, LineNoise,
                         testing::Values(std::pair{Sigma{"row_fixed_e", &simsense_signal::row_fixed_e, true}, true},
                                         std::pair{Sigma{"row_noise_e", &simsense_signal::row_noise_e, false}, true},
                                         std::pair{Sigma{"column_fixed_e", &simsense_signal::column_fixed_e, true}, false},
                                         std::pair{Sigma{"column_noise_e", &simsense_signal::column_noise_e, false}, false}),
                         [](const auto& info) { return std::string(info.param.first.name); });

// Goodman, Speckle Phenomena in Optics, 3.2: coherent light has it, and incoherent light beside it lowers the contrast.
TEST(SpeckleOfTheLaser, HasItsVarianceBesideSteadyLight) {
  simsense_signal s = fine_signal(100);
  s.speckle_shape = 4;
  s.speckle_scale = 0.25f;
  const std::vector<float> all(static_cast<size_t>(field_pixels), 100.0f), half(all.size(), 50.0f), none(all.size(), 0.0f);
  const auto law = [&](const std::vector<float>& laser) { return moments(measure(s, {}, all, field_width, field_height, 2, &laser)); };
  EXPECT_NEAR(law(half).mean, 1000 + 100 * 100, 5 * 100 * 25 / std::sqrt(field_pixels));
  EXPECT_NEAR(law(half).variance / (100 * 100), 50.0 * 50 / 4, 0.02 * 50 * 50 / 4);
  EXPECT_EQ(measure(s, {}, all, field_width, field_height, 2, &none), std::vector<double>(all.size(), 1000 + 100 * 100));
  EXPECT_NEAR(law(all).variance, moments(measure(s, {}, all)).variance, 1);
}

TEST(Prnu, IsAFixedShareOfTheLight) {
  simsense_signal s = fine_signal(10);
  s.prnu = 0.02f;
  for (const float light : {1000.0f, 4000.0f}) {
    const double deviation = std::sqrt(moments(flat(s, light)).variance);
    EXPECT_NEAR(deviation / (10 * light), 0.02, 0.02 * relative_error_of_variance());
  }
  s.dark_current_e_per_s = 500;
  EXPECT_EQ(moments(flat(s, 0)).variance, 0) << "dark charge is not light";
  EXPECT_GT(correlation(flat(s, 1000, {1, 0}), flat(s, 4000, {1, 5})), 0.9999);
  EXPECT_LT(std::abs(correlation(flat(s, 1000, {1, 0}), flat(s, 1000, {1, 0, 0, 0, 1}))), correlation_limit) << "the other camera";
}

TEST(DarkSignal, GrowsWithTimeAndDoublesWithTemperature) {
  simsense_signal s = fine_signal(10, 0);
  s.dark_current_e_per_s = 40;
  s.exposure_s = 2;
  EXPECT_EQ(mean_of_field(flat(s, 0)), 800);
  s.exposure_s = 4;
  EXPECT_EQ(mean_of_field(flat(s, 0)), 1600);
  s.dark_doubling_k = 6;
  s.temperature_c = s.dark_reference_c + 12;
  EXPECT_EQ(mean_of_field(flat(s, 0)), 6400);
  s.temperature_c = s.dark_reference_c - 6;
  EXPECT_EQ(mean_of_field(flat(s, 0)), 800);
  s.dark_current_e_per_s = 0;
  s.black_level_dn = 100;
  s.black_level_dn_per_k = 2;
  EXPECT_EQ(mean_of_field(flat(s, 0)), 88);
}

TEST(DarkSignal, HasShotNoise) {
  simsense_signal s = fine_signal(1, 0);
  s.dark_current_e_per_s = 500;
  s.shot_noise = 1;
  EXPECT_NEAR(moments(flat(s, 0)).variance / 500, 1, relative_error_of_variance());
}

TEST(HotPixels, AreAFixedShareOfExponentialStrength) {
  simsense_signal s = fine_signal(10, 0);
  s.hot_pixel_share = 0.05f;
  s.hot_pixel_e_per_s = 200;
  const auto first = flat(s, 0, {1, 0});
  EXPECT_EQ(first, flat(s, 0, {1, 1}));
  std::vector<double> hot;
  for (const double count : first)
    if (count > 0) hot.push_back(count);
  const double expected = 0.05 * field_pixels, error = 5 / std::sqrt(expected);
  EXPECT_NEAR(static_cast<double>(hot.size()) / expected, 1, error);
  const Moments m = moments(hot);
  EXPECT_NEAR(m.mean / 2000, 1, error);
  EXPECT_NEAR(std::sqrt(m.variance) / m.mean, 1, 2 * error) << "an exponential law's deviation is its mean";
  s.temperature_c = s.dark_reference_c + s.dark_doubling_k;
  EXPECT_NEAR(mean_of_field(flat(s, 0, {1, 0})) / mean_of_field(first), 2, 0.001);
}

TEST(FullWell, CutsChargeAndItsNoise) {
  simsense_signal s = fine_signal(1, 0);
  s.shot_noise = 1;
  s.full_well_e = 5000;
  const Moments full = moments(flat(s, 6000)), half = moments(flat(s, 5000));
  EXPECT_NEAR(full.mean, 5000, 1e-6);
  EXPECT_NEAR(full.variance, 0, 1e-9);
  EXPECT_NEAR(half.mean, 5000 - std::sqrt(5000 / (2 * M_PI)), 0.5) << "the lower half of the law stays";
}

TEST(Blooming, ConservesCharge) {
  simsense_signal s = fine_signal(1, 0);
  s.full_well_e = 1000;
  s.blooming = 1;
  const auto counts = spot(s, 300, 5000, 3, 7);
  const double put_in = 300 * field_pixels + (5000 - 300) * 3 * 7;
  EXPECT_NEAR(std::accumulate(counts.begin(), counts.end(), 0.0), put_in, 3);
  EXPECT_EQ(*std::max_element(counts.begin(), counts.end()), 1000);
  const auto at = [&](uint32_t x, uint32_t y) { return counts[size_t{y} * field_width + x]; };
  EXPECT_EQ(at(99, 203), 300) << "charge stays in its column";
  // 7 * 4000 electrons of overflow, half each way, into room for 700 a pixel: 20 pixels up and down.
  EXPECT_EQ(at(101, 200 - 20), 1000);
  EXPECT_EQ(at(101, 200 - 21), 300);
  EXPECT_EQ(at(101, 206 + 20), 1000);
  EXPECT_EQ(at(101, 206 + 21), 300);
  s.blooming = 0.25f;  // the drain takes the rest
  const auto drained = spot(s, 0, 9000, 1, 1);
  EXPECT_NEAR(std::accumulate(drained.begin(), drained.end(), 0.0), 1000 + 0.25 * 8000, 1);
}

TEST(Response, IsMonotoneAndInvertible) {
  std::vector<float> ramp(static_cast<size_t>(field_pixels));
  for (size_t i = 0; i < ramp.size(); ++i) ramp[i] = 65535.0f * static_cast<float>(i) / static_cast<float>(ramp.size() - 1);
  for (const float exponent : {0.45f, 0.8f, 1.3f, 2.2f}) {
    simsense_signal s = fine_signal(1, 0);
    s.response_exponent = exponent;
    const auto counts = measure(s, {}, ramp);
    EXPECT_TRUE(std::is_sorted(counts.begin(), counts.end()));
    EXPECT_EQ(counts.front(), 0);
    EXPECT_EQ(counts.back(), 65535);
    for (size_t i = ramp.size() / 20; i < ramp.size(); i += 97) {
      const double inverse = 65535 * std::pow(counts[i] / 65535, 1 / double{exponent});
      const double step = std::pow(counts[i] / 65535, 1 / double{exponent} - 1) / exponent;  // input counts per output count
      ASSERT_NEAR(inverse, ramp[i], 0.51 * step + 2e-6 * 65535) << exponent;
    }
  }
}

TEST(Response, KeepsTheMeanOfNoiseInTheDark) {
  simsense_signal s = fine_signal(10, 20000);
  s.read_noise_e = 30;
  s.response_exponent = 0.6f;
  EXPECT_NEAR(moments(flat(s, 0)).skewness, 0, 5 * std::sqrt(6 / field_pixels));
}

TEST(Quantisation, AddsATwelfthAtEveryBitDepth) {
  for (uint32_t bits = 8; bits <= 16; ++bits) {
    simsense_signal s = simsense_signal_init();
    s.bit_depth = bits;
    const double full_scale = std::pow(2.0, bits) - 1;
    const Moments m = errors_of(s, spread_over(0, full_scale));
    EXPECT_NEAR(m.mean, 0, 5 * std::sqrt(1 / (12 * field_pixels))) << bits;
    EXPECT_NEAR(m.variance * 12, 1, 0.01) << bits;
    EXPECT_EQ(flat(s, 1e6f)[0], full_scale) << bits;
  }
}

TEST(PresetD435, HasTheMeasuredVarianceLaw) {
  const simsense_signal s = signal_preset("d435");
  for (const float dn : {20.0f, 60.0f, 146.0f}) {
    // Means spread over one count, as a smooth scene's are, so that steps add their twelfth.
    const double variance = errors_of(s, spread_over(double{dn}, 1)).variance;
    EXPECT_NEAR(variance, 0.00497 * (dn + 0.5) + 0.01 + 1.0 / 12, 0.03 * (0.00497 * dn + 0.1)) << dn;
  }
}
