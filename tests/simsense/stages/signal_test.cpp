// Laws of the imager: distributions against their closed forms, independence of streams, and the count formula.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "device/error.h"
#include "device/thread_pool.h"
#include "ks/image.h"
#include "reference/signal.h"
#include "signal/signal.h"

using namespace simsense;

namespace {

constexpr uint32_t side = 1024;
constexpr double samples = double{side} * side;

struct Draws {
  std::vector<double> factor, normal;
};

Draws draw(float shape, float scale, const NoiseKey& key = {}) {
  const GammaSampler gamma(shape, scale);
  const PhiloxKey image = image_key(key);
  Draws draws;
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      const PixelNoise noise = pixel_noise(gamma, image, x, y);
      draws.factor.push_back(noise.factor);
      draws.normal.push_back(noise.normal);
    }
  return draws;
}

struct Moments {
  double mean = 0, variance = 0, skewness = 0, kurtosis = 0;
};

Moments moments(const std::vector<double>& values) {
  Moments m;
  const double n = static_cast<double>(values.size());
  for (double v : values) m.mean += v / n;
  double third = 0, fourth = 0;
  for (double v : values) {
    const double d = v - m.mean;
    m.variance += d * d / n;
    third += d * d * d / n;
    fourth += d * d * d * d / n;
  }
  m.skewness = third / std::pow(m.variance, 1.5);
  m.kurtosis = fourth / (m.variance * m.variance);
  return m;
}

double correlation(const std::vector<double>& a, const std::vector<double>& b) {
  const Moments ma = moments(a), mb = moments(b);
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - ma.mean) * (b[i] - mb.mean);
  return sum / (static_cast<double>(a.size()) * std::sqrt(ma.variance * mb.variance));
}

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

template <class T>
ConstPlane packed(const std::vector<T>& image, uint32_t width, uint32_t format) {
  return {reinterpret_cast<const std::byte*>(image.data()), static_cast<ptrdiff_t>(width * sizeof(T)), sizeof(T), format};
}

std::vector<uint8_t> run(const SignalParameters& p, const NoiseKey& key, const ConstPlane& input, uint32_t width, uint32_t height,
                         unsigned workers = 2) {
  ks::ThreadPool pool(workers);
  std::vector<uint8_t> counts(size_t{width} * height);
  measure(p, key, input, width, height, counts.data(), pool);
  return counts;
}

std::vector<uint8_t> ramp(uint32_t width, uint32_t height) {
  std::vector<uint8_t> image(size_t{width} * height);
  for (size_t i = 0; i < image.size(); ++i) image[i] = static_cast<uint8_t>((i * 37) % 251);
  return image;
}

}  // namespace

TEST(Philox, GivesThePublishedAnswers) {
  // Known answers of the authors' Random123 distribution, philox4x32-10.
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (PhiloxBlock{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr uint32_t all = 0xffffffff;
  EXPECT_EQ(philox({all, all, all, all}, {all, all}), (PhiloxBlock{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (PhiloxBlock{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

class GammaLaw : public testing::TestWithParam<double> {};

TEST_P(GammaLaw, MomentsAreThoseOfTheClosedForm) {
  const double shape = GetParam(), scale = 1.01 / shape;
  const Moments m = moments(draw(static_cast<float>(shape), static_cast<float>(scale)).factor);
  const double excess = 6 / shape;  // excess kurtosis of the gamma distribution
  EXPECT_NEAR(m.mean, shape * scale, 5 * std::sqrt(shape * scale * scale / samples));
  EXPECT_NEAR(m.variance, shape * scale * scale, 5 * shape * scale * scale * std::sqrt((2 + excess) / samples));
  EXPECT_NEAR(m.skewness, 2 / std::sqrt(shape), 0.01 + 0.02 * 2 / std::sqrt(shape));
}

INSTANTIATE_TEST_SUITE_P(Shapes, GammaLaw, testing::Values(0.5, 1.0, 3.98, 398.12, 1371.0));

TEST(Gamma, ShapesOneAndOneHalfFollowTheirDistributions) {
  const double scale = 0.7;
  EXPECT_LT(kolmogorov(draw(1.0f, 0.7f).factor, [&](double x) { return 1 - std::exp(-x / scale); }), 1.95);
  EXPECT_LT(kolmogorov(draw(0.5f, 0.7f).factor, [&](double x) { return std::erf(std::sqrt(x / scale)); }), 1.95);
}

TEST(Gaussian, FollowsTheNormalDistribution) {
  const std::vector<double> normal = draw(3.98f, 0.254f).normal;
  const Moments m = moments(normal);
  EXPECT_NEAR(m.mean, 0, 5 / std::sqrt(samples));
  EXPECT_NEAR(m.variance, 1, 5 * std::sqrt(2 / samples));
  EXPECT_NEAR(m.skewness, 0, 5 * std::sqrt(6 / samples));
  EXPECT_NEAR(m.kurtosis, 3, 5 * std::sqrt(24 / samples));
  EXPECT_LT(kolmogorov(normal, [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }), 1.95);
}

TEST(NoiseStreams, AreDecorrelated) {
  const NoiseKey key{7, 3, 1, 0};
  const Draws base = draw(3.98f, 0.254f, key);
  const double limit = 5 / std::sqrt(samples);
  EXPECT_LT(std::abs(correlation(base.factor, base.normal)), limit) << "factor against normal";
  const NoiseKey others[] = {{8, 3, 1, 0}, {7, 4, 1, 0}, {7, 3, 2, 0}, {7, 3, 1, 1}};
  for (const NoiseKey& other : others) {
    const Draws draws = draw(3.98f, 0.254f, other);
    EXPECT_LT(std::abs(correlation(base.factor, draws.factor)), limit);
    EXPECT_LT(std::abs(correlation(base.normal, draws.normal)), limit);
  }
  const std::vector<double> right(base.factor.begin() + 1, base.factor.end()), left(base.factor.begin(), base.factor.end() - 1);
  EXPECT_LT(std::abs(correlation(left, right)), limit) << "neighbouring pixels";
}

TEST(Signal, DoesNotDependOnTheNumberOfWorkers) {
  const auto image = ramp(203, 61);
  const SignalParameters p{1, 4, 3.98f, 0.254f, -0.231f, 0.83f};
  const auto one = run(p, {5, 9, 2, 1}, packed(image, 203, KS_FORMAT_U8), 203, 61, 1);
  for (unsigned workers : {2u, 3u, 7u}) EXPECT_EQ(one, run(p, {5, 9, 2, 1}, packed(image, 203, KS_FORMAT_U8), 203, 61, workers)) << workers;
}

TEST(Signal, EqualsTheReference) {
  const uint32_t width = 400, height = 300;
  std::vector<float> image(size_t{width} * height);
  for (size_t i = 0; i < image.size(); ++i) image[i] = 0.001f * static_cast<float>(i % 977);
  const std::vector<double> exact(image.begin(), image.end());
  for (const SignalParameters& p : {SignalParameters{200, 4}, SignalParameters{200, 4, 3.98f, 0.254f, -0.231f, 0.83f},
                                    SignalParameters{255, 0, 0.6f, 1.6f, 0, 0}, SignalParameters{180, 2, 0, 0, 1.5f, 3}}) {
    const auto fast = run(p, {1, 2, 3, 0}, packed(image, width, KS_FORMAT_F32), width, height);
    const auto slow = reference::measure(p, {1, 2, 3, 0}, exact, width, height);
    size_t different = 0;
    int worst = 0;
    for (size_t i = 0; i < fast.size(); ++i) {
      different += fast[i] != slow[i];
      worst = std::max(worst, std::abs(fast[i] - slow[i]));
    }
    EXPECT_LE(worst, 1);
    EXPECT_LT(static_cast<double>(different), 5e-4 * static_cast<double>(fast.size()));
  }
}

TEST(Signal, QuietCountsAreTheRoundedAffineOfTheInput) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> f32{0, 0.25f, 0.75f, 1.25f, 300, -5, nan, inf};
  EXPECT_EQ(run({2, 0}, {}, packed(f32, 8, KS_FORMAT_F32), 8, 1), (std::vector<uint8_t>{0, 0, 2, 2, 255, 0, 0, 255}));
  EXPECT_EQ(run({1, 10}, {}, packed(f32, 8, KS_FORMAT_F32), 8, 1)[5], 5);
  const std::vector<uint16_t> u16{0, 1, 255, 256, 65535};
  EXPECT_EQ(run({1, 0}, {}, packed(u16, 5, KS_FORMAT_U16), 5, 1), (std::vector<uint8_t>{0, 1, 255, 255, 255}));
  EXPECT_EQ(run({255.0f / 65535, 0}, {}, packed(u16, 5, KS_FORMAT_U16), 5, 1), (std::vector<uint8_t>{0, 0, 1, 1, 255}));
  const std::vector<uint8_t> u8{0, 100, 254, 255};
  EXPECT_EQ(run({1, 1, 0, 0, 0.2f, 0}, {}, packed(u8, 4, KS_FORMAT_U8), 4, 1), (std::vector<uint8_t>{1, 101, 255, 255}));
}

TEST(Signal, ReadsAnyStrides) {
  const uint32_t width = 64, height = 48;
  const auto image = ramp(width, height);
  std::vector<uint16_t> spaced(size_t{width} * height * 6, 9999);  // flipped both ways, every third column, every second row
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) spaced[size_t{2} * (height - 1 - y) * 3 * width + 3 * (width - 1 - x)] = image[y * width + x];
  const auto* last = spaced.data() + size_t{2} * (height - 1) * 3 * width + 3 * (width - 1);
  const ConstPlane flipped{reinterpret_cast<const std::byte*>(last), -ptrdiff_t{2 * 3 * width * 2}, -6, KS_FORMAT_U16};
  for (const SignalParameters& p : {SignalParameters{}, SignalParameters{1, 4, 3.98f, 0.254f, -0.231f, 0.83f}})
    EXPECT_EQ(run(p, {1}, packed(image, width, KS_FORMAT_U8), width, height), run(p, {1}, flipped, width, height));
}

TEST(Signal, RefusesOtherFormats) {
  const std::vector<uint32_t> image(4);
  EXPECT_THROW(run({}, {}, packed(image, 2, KS_FORMAT_U32), 2, 2), ks::Error);
}
