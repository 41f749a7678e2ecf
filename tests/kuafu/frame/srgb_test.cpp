// SPDX-License-Identifier: Apache-2.0
// Bytes of sRGB against the curve in double precision, of every kind of float, and the same from shaders and native stages.
#include "frame/srgb.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

namespace kuafu {
namespace {

constexpr uint32_t width = 257;  // odd: the last column is looked at, and rows are no multiple of a group

std::shared_ptr<ks::Device> device() {
  static const std::shared_ptr<ks::Device> shared = ks::Device::create(ks_device_desc_init());
  return shared;
}

double encoded(double light) { return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055; }

uint32_t byte_of(float light, float exposure) {
  const float lit = light * exposure;
  return !(lit > 0.0f) ? 0 : uint32_t(std::floor(255.0 * encoded(std::min(1.0, double(lit))) + 0.5));
}

/// All upper halves of a float with three lower ones: infinities, NaN, denormal and negative numbers are among them.
std::vector<float> all_kinds() {
  std::vector<float> values;
  for (uint32_t upper = 0; upper < 0x10000; ++upper)
    for (const uint32_t lower : {0x0001u, 0x8000u, 0xffffu}) values.push_back(std::bit_cast<float>(upper << 16 | lower));
  for (uint32_t byte = 1; byte < 256; ++byte) {  // on both sides of where a byte begins
    const double code = (byte - 0.5) / 255;
    const auto start = float(code <= 0.04045 ? code / 12.92 : std::pow((code + 0.055) / 1.055, 2.4));
    for (const float side : {0.0f, 2.0f}) values.push_back(std::nextafter(start, side));
  }
  for (const float exact : {0.0f, -0.0f, 1.0f, std::numeric_limits<float>::infinity()}) values.push_back(exact);
  return values;
}

uint32_t height_of(const std::vector<float>& light) { return uint32_t(light.size() / 3 / width); }

std::vector<uint32_t> words_of(const std::vector<float>& light, float exposure, bool on_host) {
  const Memory memory{device(), on_host};
  const auto from = ks::Buffer::create(device(), light.size() * 4, KS_BUFFER_HOST_VISIBLE);
  from->write(0, light.data(), light.size() * 4);
  std::vector<uint32_t> words(size_t(width) * height_of(light));
  const auto to = ks::Buffer::create(device(), words.size() * 4, KS_BUFFER_HOST_VISIBLE);
  SrgbEncoder encoder(memory);
  ks::Commands commands(device());
  const OutputRecord target{.words = memory.address(*to),
                            .first = 0,
                            .view_stride = 0,
                            .row_stride = int(width) * 4,
                            .enabled = 1,
                            .format = format_u8,
                            .scale = exposure};
  for (int twice = 0; twice < 2; ++twice)  // the second counts the light again
    encoder.run(commands, memory.address(*from), target, 1, width, height_of(light));
  commands.flush();
  to->read(0, words.data(), words.size() * 4);
  return words;
}

class SrgbBytes : public testing::TestWithParam<bool> {};

TEST_P(SrgbBytes, follow_the_curve_for_every_kind_of_float) {
  if (GetParam() && !device()->is_cpu()) GTEST_SKIP() << "native stages need a CPU device, this is " << device()->info().name;
  std::vector<float> light = all_kinds();
  light.resize(light.size() / (3 * width) * 3 * width + 3 * width);
  for (const float exposure : {1.0f, 0.37f, 1e4f}) {
    const std::vector<uint32_t> words = words_of(light, exposure, GetParam());
    for (size_t i = 0; i < light.size(); ++i) {
      const uint32_t byte = words[i / 3] >> 8 * (i % 3) & 0xff;
      const bool is_denormal = std::fpclassify(light[i]) == FP_SUBNORMAL;
      ASSERT_EQ(byte, is_denormal ? 0 : byte_of(light[i], exposure)) << light[i] << " under " << exposure;
    }
    for (const uint32_t word : words) ASSERT_EQ(word >> 24, 255u);
  }
}

TEST_P(SrgbBytes, put_the_median_lit_green_at_a_quarter_of_white) {
  if (GetParam() && !device()->is_cpu()) GTEST_SKIP() << "native stages need a CPU device, this is " << device()->info().name;
  constexpr uint32_t height = 101;
  std::mt19937 random(3);
  std::lognormal_distribution<float> draw(4.0f, 2.0f);
  std::vector<float> light(size_t(width) * height * 3, 1e9f);  // what is not looked at is much brighter
  std::vector<float> greens;
  for (uint32_t row = 0; row < height; row += 2)
    for (uint32_t column = 0; column < width; column += 2) {
      float& green = light[(size_t(row) * width + column) * 3 + 1];
      green = column % 3 == 0 ? -draw(random) : column % 5 == 0 ? std::numeric_limits<float>::quiet_NaN() : draw(random);
      if (green > 0) greens.push_back(green);
    }
  std::ranges::sort(greens);
  const float median = greens[(greens.size() - 1) / 2];
  const auto at = size_t(std::ranges::find(light, median) - light.begin());
  const std::vector<uint32_t> words = words_of(light, 0.0f, GetParam());
  EXPECT_NEAR(double(words[at / 3] >> 8 & 0xff), 255 * encoded(0.25), 1.0);
  EXPECT_EQ(words, words_of(light, 0.0f, !GetParam() && device()->is_cpu()));
  const auto middle = std::bit_cast<float>((std::bit_cast<uint32_t>(median) & 0xffff0000u) | 0x8000u);
  EXPECT_EQ(words, words_of(light, 0.25f / middle, GetParam()));
  const std::vector<float> dark(light.size(), 0.0f);
  for (const uint32_t word : words_of(dark, 0.0f, GetParam())) ASSERT_EQ(word, 0xff000000u);
}

INSTANTIATE_TEST_SUITE_P(Each, SrgbBytes, testing::Bool(), [](const auto& info) { return info.param ? "native" : "shaders"; });

}  // namespace
}  // namespace kuafu
