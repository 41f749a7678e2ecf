// SPDX-License-Identifier: Apache-2.0
// Laws of the imager's random numbers: the generator, and the quantiles against closed forms.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "cpu/signal/rows.h"
#include "cpu/simd/buffer.h"
#include "signal/gamma_quantile.h"
#include "simsense/reference/imager.h"
#include "simsense/signal/signal_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

/// sqrt(n) times the Kolmogorov-Smirnov distance; above 1.95 the distribution is refuted at 0.1 %.
template <class Cdf>
double kolmogorov(std::vector<double> values, Cdf&& cdf) {
  std::sort(values.begin(), values.end());
  const double n = static_cast<double>(values.size());
  double distance = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    const double expected = cdf(values[i]);
    distance = std::max({distance, expected - static_cast<double>(i) / n, static_cast<double>(i + 1) / n - expected});
  }
  return distance * std::sqrt(n);
}

struct NormalField {
  cpu::Buffer<uint32_t> words{size_t{field_width} * field_height};
  std::vector<double> normals;

  NormalField(const NoiseKey& noise_key, Dimension dimension, int32_t x0 = 0) {
    const StreamKeys keys(noise_key);
    cpu::Buffer<float> row(field_width);
    for (uint32_t y = 0; y < field_height; ++y) {
      cpu::normal_row(keys.frame, dimension, x0, y, field_width, words.data() + size_t{y} * field_width, row.data());
      normals.insert(normals.end(), row.data(), row.data() + field_width);
    }
  }
};

}  // namespace

TEST(Philox, GivesThePublishedAnswers) {
  // Known answers of the authors' Random123 distribution, philox4x32-10.
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (PhiloxBlock{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr uint32_t all = 0xffffffff;
  EXPECT_EQ(philox({all, all, all, all}, {all, all}), (PhiloxBlock{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (PhiloxBlock{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(Words, OfVectorsAreThoseOfPixels) {
  const NoiseKey key{7, 3, 0, 1, 0};
  for (const int32_t x0 : {0, -64}) {
    const NormalField field(key, Dimension::read, x0);
    for (uint32_t y = 0; y < field_height; y += 61)
      for (uint32_t x = 0; x < field_width; ++x)
        ASSERT_EQ(field.words.data()[size_t{y} * field_width + x],
                  pixel_word(StreamKeys(key).frame, Dimension::read, x + static_cast<uint32_t>(x0), y));
  }
}

TEST(NormalQuantile, FollowsTheNormalDistribution) {
  const NormalField field({}, Dimension::read);
  const Moments m = moments(field.normals);
  EXPECT_NEAR(m.mean, 0, 5 / std::sqrt(field_pixels));
  EXPECT_NEAR(m.variance, 1, 5 * std::sqrt(2 / field_pixels));
  EXPECT_NEAR(m.skewness, 0, 5 * std::sqrt(6 / field_pixels));
  EXPECT_NEAR(m.kurtosis, 3, 5 * std::sqrt(24 / field_pixels));
  EXPECT_LT(kolmogorov(field.normals, [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }), 1.95);
}

TEST(NormalQuantile, IsThatOfItsWordToTwoMillionths) {
  const NormalField field({}, Dimension::read);
  for (size_t i = 0; i < field.normals.size(); i += 7)
    ASSERT_NEAR(field.normals[i], reference::normal_quantile(field.words.data()[i]), 2e-6);
}

TEST(NormalQuantile, ReachesBothTails) {
  EXPECT_NEAR(reference::normal_quantile(0), -6.3379, 1e-3);  // Phi^-1(2^-33)
  EXPECT_NEAR(reference::normal_quantile(0xffffffffu), 6.3379, 1e-3);
}

TEST(GammaQuantile, InvertsTheClosedForms) {
  for (double z = -6; z <= 6; z += 0.25) {
    const double lower = 0.5 * std::erfc(-z / std::sqrt(2.0)), upper = 0.5 * std::erfc(z / std::sqrt(2.0));
    const double exponential = z < 0 ? -std::log1p(-lower) : -std::log(upper), x = gamma_quantile(1, z);
    EXPECT_NEAR(x / exponential, 1, 1e-9) << z;
    const double half = gamma_quantile(0.5, z);  // Gamma(1/2): half a squared normal, P = erf(sqrt x)
    EXPECT_NEAR(std::erf(std::sqrt(half)) / lower, 1, 1e-8) << z;
    const double three = gamma_quantile(3, z);  // Q = e^-x (1 + x + x^2 / 2)
    EXPECT_NEAR(std::exp(-three) * (1 + three + three * three / 2) / upper, 1, 1e-8) << z;
  }
}

TEST(GammaQuantile, HasNoStepWhereItsMethodChanges) {
  for (const double z : {-4.0, -1.0, 0.0, 2.0, 5.0})
    EXPECT_NEAR(gamma_quantile(9999.9, z) / gamma_quantile(10000.1, z), 1 - 2e-5, 3e-6) << z;
}

TEST(PoissonQuantile, OfTheReferenceIsTheLeastCountThatReachesItsUniform) {
  for (const double mean : {0.01, 0.7, 4.0, 9.99, 30.0}) {
    for (uint32_t word = 1u << 20; word < 0xfff00000u; word += 0x00f0f0f1u) {
      const double n = reference::poisson_quantile(mean, word);
      double below = 0;
      for (double k = 0; k < n; ++k) below += std::exp(k * std::log(mean) - mean - std::lgamma(k + 1));
      const double reached = below + std::exp(n * std::log(mean) - mean - std::lgamma(n + 1)), uniform = (word + 0.5) / 4294967296.0;
      ASSERT_LT(below, uniform + 1e-12);
      ASSERT_GE(reached, uniform - 1e-12);
      if (word > 0xfff00000u - 0x00f0f0f1u) break;
    }
  }
}

TEST(NoiseStreams, AreDecorrelated) {
  const NoiseKey key{7, 3, 0, 1, 0};
  const NormalField base(key, Dimension::read);
  const NoiseKey others[] = {{8, 3, 0, 1, 0}, {7, 4, 0, 1, 0}, {7, 3, 0, 2, 0}, {7, 3, 0, 1, 1}};
  for (const NoiseKey& other : others)
    EXPECT_LT(std::abs(correlation(base.normals, NormalField(other, Dimension::read).normals)), correlation_limit);
  EXPECT_LT(std::abs(correlation(base.normals, NormalField(key, Dimension::adc).normals)), correlation_limit) << "another dimension";
  for (const size_t lag : {size_t{1}, size_t{2}, size_t{3}, size_t{4}, size_t{field_width}}) {
    const std::vector<double> later(base.normals.begin() + static_cast<ptrdiff_t>(lag), base.normals.end());
    EXPECT_LT(std::abs(correlation({base.normals.begin(), base.normals.end() - static_cast<ptrdiff_t>(lag)}, later)), correlation_limit)
        << lag;
  }
}
