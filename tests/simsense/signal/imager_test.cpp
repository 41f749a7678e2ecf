// SPDX-License-Identifier: Apache-2.0
// The imager as a whole: equal to the reference, the same bits on every instruction set, neutral where asked.
#include <gtest/gtest.h>

#include "cpu/signal/rows.h"
#include "device/error.h"
#include "hwy/targets.h"
#include "simsense/reference/imager.h"
#include "simsense/signal/signal_samples.h"

using namespace simsense;
using namespace simsense_test;

namespace {

constexpr uint32_t width = 203, height = 61;
const NoiseKey key{5, 9, 4, 2, 1};

const std::vector<float> image = ramp(size_t{width} * height);

template <class T>
std::vector<uint8_t> counts_of(const simsense_signal& signal, const std::vector<T>& image, uint32_t format) {
  ks::ThreadPool workers(1);
  std::vector<uint8_t> counts(image.size());
  simsense::cpu::measure(Imager(signal), key, {packed(image, static_cast<uint32_t>(image.size()), format)},
                         static_cast<uint32_t>(image.size()), 1, counts.data(), workers);
  return counts;
}

simsense_signal affine(float gain, float black_dn) {
  simsense_signal s = simsense_signal_init();
  s.gain = gain;
  s.black_level_dn = black_dn;
  return s;
}

}  // namespace

TEST(Imager, EqualsTheReferenceButForRounding) {
  for (const auto& [name, signal] : every_stage()) {
    const auto fast = measure(signal, key, image, width, height);
    expect_equal_but_for_rounding(fast, reference::measure(signal, key, {image.begin(), image.end()}, width, height), name);
    EXPECT_NE(fast, std::vector<double>(image.begin(), image.end())) << name << " does nothing";
  }
}

TEST(Imager, SpeckleOfTheLaserAloneEqualsTheReferenceButForRounding) {
  const std::vector<float> laser = laser_part(image);
  for (const auto& [name, signal] : every_stage()) {
    if (signal.speckle_shape == 0) continue;
    const auto exact = reference::measure(signal, key, {image.begin(), image.end()}, width, height, {laser.begin(), laser.end()});
    expect_equal_but_for_rounding(measure(signal, key, image, width, height, 2, &laser), exact, name);
  }
}

TEST(Imager, GivesTheSameBitsOnEveryInstructionSet) {
  for (const auto& [name, signal] : every_stage()) {
    const auto best = measure(signal, key, image, width, height);
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
      hwy::SetSupportedTargetsForTest(target);
      EXPECT_EQ(best, measure(signal, key, image, width, height)) << name << " on " << hwy::TargetName(target);
    }
    hwy::SetSupportedTargetsForTest(0);
  }
}

TEST(Imager, IsNeutralAtFirstAndOnlyThen) {
  EXPECT_TRUE(Imager().is_neutral());
  EXPECT_EQ(measure(simsense_signal_init(), key, image, width, height), std::vector<double>(image.begin(), image.end()));
  for (const auto& [name, signal] : every_stage()) EXPECT_FALSE(Imager(signal).is_neutral()) << name;
}

TEST(Imager, MadeOfAFormerOneIsAsNew) {
  ks::ThreadPool workers(1);
  for (const auto& [former_name, former] : every_stage()) {
    const Imager from(former);
    for (const auto& [name, signal] : every_stage()) {
      std::vector<uint16_t> counts(image.size());
      simsense::cpu::measure(Imager(signal, &from), key, {packed(image, width, KS_FORMAT_F32)}, width, height, counts.data(), workers);
      EXPECT_EQ(std::vector<double>(counts.begin(), counts.end()), measure(signal, key, image, width, height))
          << former_name << ", " << name;
    }
  }
}

TEST(Imager, QuietCountsAreTheRoundedAffineOfTheInput) {
  const std::vector<float> f32{0, 0.25f, 0.75f, 1.25f, 300, -5, wild[7], infinite};
  EXPECT_EQ(counts_of(affine(2, 0), f32, KS_FORMAT_F32), (std::vector<uint8_t>{0, 0, 2, 2, 255, 0, 0, 255}));
  EXPECT_EQ(counts_of(affine(1, 10), f32, KS_FORMAT_F32)[5], 5);
  const std::vector<uint16_t> u16{0, 1, 255, 256, 65535};
  EXPECT_EQ(counts_of(affine(1, 0), u16, KS_FORMAT_U16), (std::vector<uint8_t>{0, 1, 255, 255, 255}));
  EXPECT_EQ(counts_of(affine(255.0f / 65535, 0), u16, KS_FORMAT_U16), (std::vector<uint8_t>{0, 0, 1, 1, 255}));
  const std::vector<uint8_t> u8{0, 100, 254, 255};
  EXPECT_EQ(counts_of(affine(1, 1.2f), u8, KS_FORMAT_U8), (std::vector<uint8_t>{1, 101, 255, 255}));
}

TEST(Imager, StaysFiniteUnderAnyInput) {
  for (const auto& [name, signal] : every_stage()) expect_in_range(measure(signal, key, wild, 8, 1), name, signal);
}

TEST(Imager, ReadsAnyStrides) {
  const std::vector<uint8_t> bytes(image.begin(), image.end());
  std::vector<uint16_t> spaced(size_t{width} * height * 6, 9999);  // flipped both ways, every third column, every second row
  for (uint32_t y = 0; y < height; ++y)
    for (uint32_t x = 0; x < width; ++x) spaced[size_t{2} * (height - 1 - y) * 3 * width + 3 * (width - 1 - x)] = bytes[y * width + x];
  const auto* last = spaced.data() + size_t{2} * (height - 1) * 3 * width + 3 * (width - 1);
  const ConstPlane flipped{reinterpret_cast<const std::byte*>(last), -ptrdiff_t{2 * 3 * width * 2}, -6, KS_FORMAT_U16};
  ks::ThreadPool workers(2);
  std::vector<uint8_t> plain(bytes.size()), turned(bytes.size());
  const Imager imager(signal_preset("paper-d415"));
  simsense::cpu::measure(imager, key, {packed(bytes, width, KS_FORMAT_U8)}, width, height, plain.data(), workers);
  simsense::cpu::measure(imager, key, {flipped}, width, height, turned.data(), workers);
  EXPECT_EQ(plain, turned);
}

TEST(Imager, RefusesOtherFormats) { EXPECT_THROW(counts_of(affine(1, 0), std::vector<uint32_t>(4), KS_FORMAT_U32), ks::Error); }
