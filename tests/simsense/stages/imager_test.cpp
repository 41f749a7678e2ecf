// The imager as a whole: equal to the reference, the same bits on every instruction set and number of workers, neutral where told.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "cpu/signal/rows.h"
#include "device/error.h"
#include "hwy/targets.h"
#include "reference/imager.h"
#include "signal/presets.h"
#include "simsense/stages/signal_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

constexpr uint32_t width = 203, height = 61;
const NoiseKey key{5, 9, 4, 2, 1};

std::vector<float> ramp() {
  std::vector<float> image(size_t{width} * height);
  for (size_t i = 0; i < image.size(); ++i) image[i] = static_cast<float>((i * 37) % 251);
  return image;
}

/// Each stage alone, and all of them; every one does something to the ramp.
std::vector<std::pair<const char*, simsense_signal>> signals() {
  std::vector<std::pair<const char*, simsense_signal>> all;
  const auto add = [&](const char* name, auto&& change) {
    simsense_signal s = simsense_signal_init();
    change(s);
    all.emplace_back(name, s);
  };
  add("exposure", [](simsense_signal& s) { s.exposure_s = 0.01f, s.responsivity_e = 77.13f; });
  add("temporal speckle", [](simsense_signal& s) { s.speckle_shape = 3.98f, s.speckle_scale = 0.254f; });
  add("static speckle", [](simsense_signal& s) { s.speckle_shape = 0.6f, s.speckle_scale = 1.6f, s.speckle_correlation = 1; });
  add("partly static speckle", [](simsense_signal& s) { s.speckle_shape = 20, s.speckle_scale = 0.05f, s.speckle_correlation = 0.3f; });
  add("grainy speckle", [](simsense_signal& s) { s.speckle_shape = 4, s.speckle_scale = 0.25f, s.speckle_psf_sigma_px = 0.8f; });
  add("prnu", [](simsense_signal& s) { s.prnu = 0.05f; });
  add("dark", [](simsense_signal& s) { s.dark_current_e_per_s = 7, s.temperature_c = 45; });
  add("hot pixels", [](simsense_signal& s) { s.hot_pixel_share = 0.01f, s.hot_pixel_e_per_s = 100; });
  add("shot noise", [](simsense_signal& s) { s.shot_noise = 1; });
  add("weaker shot noise", [](simsense_signal& s) { s.shot_noise = 0.4f, s.responsivity_e = 30, s.conversion_gain_dn_per_e = 1.0f / 30; });
  add("full well", [](simsense_signal& s) { s.full_well_e = 150.5f; });
  add("blooming", [](simsense_signal& s) { s.full_well_e = 150.5f, s.blooming = 0.7f; });
  add("fixed patterns", [](simsense_signal& s) { s.dsnu_e = 2, s.row_fixed_e = 3, s.column_fixed_e = 4; });
  add("temporal noise", [](simsense_signal& s) { s.read_noise_e = 2, s.row_noise_e = 3, s.column_noise_e = 4; });
  add("response", [](simsense_signal& s) { s.response_exponent = 0.45f; });
  add("converter",
      [](simsense_signal& s) { s.adc_noise_dn = 0.8f, s.black_level_dn = 5.3f, s.black_level_dn_per_k = 0.1f, s.temperature_c = 33; });
  add("ten bits", [](simsense_signal& s) { s.bit_depth = 10, s.gain = 3.9137f; });
  for (const char* preset : {"paper-d415", "sapien", "d435"}) all.emplace_back(preset, signal_preset(preset));
  simsense_signal everything = signal_preset("d435");
  everything.speckle_shape = 50, everything.speckle_scale = 0.02f, everything.speckle_correlation = 0.5f, everything.prnu = 0.01f;
  everything.dark_current_e_per_s = 50, everything.hot_pixel_share = 0.002f, everything.hot_pixel_e_per_s = 9000,
  everything.temperature_c = 50;
  everything.full_well_e = 40000, everything.blooming = 0.5f, everything.dsnu_e = everything.row_fixed_e = everything.column_noise_e = 20;
  everything.read_noise_e = 30, everything.response_exponent = 0.9f, everything.black_level_dn = 8, everything.bit_depth = 12,
  everything.gain = 16;
  all.emplace_back("everything", everything);
  return all;
}

template <class T>
std::vector<uint8_t> counts_of(const simsense_signal& signal, const std::vector<T>& image, uint32_t format) {
  ks::ThreadPool workers(1);
  std::vector<uint8_t> counts(image.size());
  Imager(signal).measure(key, packed(image, static_cast<uint32_t>(image.size()), format), static_cast<uint32_t>(image.size()), 1,
                         counts.data(), workers);
  return counts;
}

simsense_signal affine(float gain, float black_dn) {
  simsense_signal s = simsense_signal_init();
  s.gain = gain;
  s.black_level_dn = black_dn;
  return s;
}

}  // namespace

// Float against double: a count changes where a value lies within rounding of a half, or a Poisson expansion misses by an electron.
TEST(Imager, EqualsTheReferenceButForRounding) {
  const std::vector<float> image = ramp();
  for (const auto& [name, signal] : signals()) {
    const auto fast = measure(signal, key, image, width, height);
    const auto exact = reference::measure(signal, key, {image.begin(), image.end()}, width, height);
    size_t different = 0;
    double worst = 0;
    for (size_t i = 0; i < fast.size(); ++i) {
      different += fast[i] != exact[i];
      worst = std::max(worst, std::abs(fast[i] - exact[i]));
    }
    EXPECT_LE(worst, 1) << name;
    EXPECT_LE(static_cast<double>(different), 1e-3 * static_cast<double>(fast.size())) << name;
    EXPECT_NE(fast, std::vector<double>(image.begin(), image.end())) << name << " does nothing";
  }
}

TEST(Imager, GivesTheSameBitsOnEveryInstructionSet) {
  for (const auto& [name, signal] : signals()) {
    const auto best = measure(signal, key, ramp(), width, height);
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      EXPECT_EQ(best, measure(signal, key, ramp(), width, height)) << name << " on " << hwy::TargetName(target);
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST(Imager, DoesNotDependOnTheNumberOfWorkers) {
  for (const auto& [name, signal] : signals()) {
    const auto one = measure(signal, key, ramp(), width, height, 1);
    for (unsigned workers : {2u, 3u, 7u}) EXPECT_EQ(one, measure(signal, key, ramp(), width, height, workers)) << name << ", " << workers;
  }
}

TEST(Imager, IsNeutralAtFirstAndOnlyThen) {
  EXPECT_TRUE(Imager().is_neutral());
  const std::vector<float> image = ramp();
  EXPECT_EQ(measure(simsense_signal_init(), key, image, width, height), std::vector<double>(image.begin(), image.end()));
  for (const auto& [name, signal] : signals()) EXPECT_FALSE(Imager(signal).is_neutral()) << name;
}

TEST(Imager, MadeOfAFormerOneIsAsNew) {
  ks::ThreadPool workers(1);
  const std::vector<float> image = ramp();
  for (const auto& [former_name, former] : signals()) {
    const Imager from(former);
    for (const auto& [name, signal] : signals()) {
      std::vector<uint16_t> counts(image.size());
      Imager(signal, &from).measure(key, packed(image, width, KS_FORMAT_F32), width, height, counts.data(), workers);
      EXPECT_EQ(std::vector<double>(counts.begin(), counts.end()), measure(signal, key, image, width, height))
          << former_name << ", " << name;
    }
  }
}

TEST(Imager, QuietCountsAreTheRoundedAffineOfTheInput) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> f32{0, 0.25f, 0.75f, 1.25f, 300, -5, nan, inf};
  EXPECT_EQ(counts_of(affine(2, 0), f32, KS_FORMAT_F32), (std::vector<uint8_t>{0, 0, 2, 2, 255, 0, 0, 255}));
  EXPECT_EQ(counts_of(affine(1, 10), f32, KS_FORMAT_F32)[5], 5);
  const std::vector<uint16_t> u16{0, 1, 255, 256, 65535};
  EXPECT_EQ(counts_of(affine(1, 0), u16, KS_FORMAT_U16), (std::vector<uint8_t>{0, 1, 255, 255, 255}));
  EXPECT_EQ(counts_of(affine(255.0f / 65535, 0), u16, KS_FORMAT_U16), (std::vector<uint8_t>{0, 0, 1, 1, 255}));
  const std::vector<uint8_t> u8{0, 100, 254, 255};
  EXPECT_EQ(counts_of(affine(1, 1.2f), u8, KS_FORMAT_U8), (std::vector<uint8_t>{1, 101, 255, 255}));
}

TEST(Imager, StaysFiniteUnderAnyInput) {
  const float inf = std::numeric_limits<float>::infinity();
  const std::vector<float> wild{-inf, -1e38f, -1, 0, 1e-40f, 1e38f, inf, std::numeric_limits<float>::quiet_NaN()};
  for (const auto& [name, signal] : signals()) {
    const auto counts = measure(signal, key, wild, 8, 1);
    const double full = std::pow(2.0, signal.bit_depth) - 1;
    EXPECT_LE(counts[0], 0.2 * full) << name;
    EXPECT_LE(counts[7], 0.2 * full) << name;
    if (signal.full_well_e == 0) {
      EXPECT_EQ(counts[6], full) << name;
    }
  }
}

TEST(Imager, ReadsAnyStrides) {
  std::vector<uint8_t> image;
  for (const float value : ramp()) image.push_back(static_cast<uint8_t>(value));
  std::vector<uint16_t> spaced(size_t{width} * height * 6, 9999);  // flipped both ways, every third column, every second row
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) spaced[size_t{2} * (height - 1 - y) * 3 * width + 3 * (width - 1 - x)] = image[y * width + x];
  const auto* last = spaced.data() + size_t{2} * (height - 1) * 3 * width + 3 * (width - 1);
  const ConstPlane flipped{reinterpret_cast<const std::byte*>(last), -ptrdiff_t{2 * 3 * width * 2}, -6, KS_FORMAT_U16};
  ks::ThreadPool workers(2);
  std::vector<uint8_t> plain(image.size()), turned(image.size());
  const Imager imager(signal_preset("paper-d415"));
  imager.measure(key, packed(image, width, KS_FORMAT_U8), width, height, plain.data(), workers);
  imager.measure(key, flipped, width, height, turned.data(), workers);
  EXPECT_EQ(plain, turned);
}

TEST(Imager, RefusesOtherFormats) { EXPECT_THROW(counts_of(affine(1, 0), std::vector<uint32_t>(4), KS_FORMAT_U32), ks::Error); }
