// SPDX-License-Identifier: Apache-2.0
// Textures on their way to the device.
#include "material/texels.h"

#include <gtest/gtest.h>

#include <cstring>
#include <glm/gtc/packing.hpp>

#include "shared/scene_records.h"

namespace {

kuafu::Texture texture(uint32_t channels, bool srgb, std::vector<uint8_t> texels) {
  kuafu::Texture t;
  t.channels = channels;
  t.srgb = srgb;
  t.width = uint32_t(texels.size() / channels);
  t.height = 1;
  t.texels = std::move(texels);
  return t;
}

glm::vec4 half4(const kuafu::Texels& t, size_t i) { return {glm::unpackHalf2x16(t.words[2 * i]), glm::unpackHalf2x16(t.words[2 * i + 1])}; }

TEST(Texels, srgb_is_decoded_and_alpha_is_not) {
  const kuafu::Texels t = kuafu::linear_texels(texture(4, true, {0, 128, 255, 128}));
  ASSERT_EQ(t.format, kuafu::texel_half4);
  const glm::vec4 rgba = half4(t, 0);
  EXPECT_EQ(rgba.r, 0.0f);
  EXPECT_NEAR(rgba.g, 0.21586, 2e-4);  // IEC 61966-2-1 of 128 / 255
  EXPECT_EQ(rgba.b, 1.0f);
  EXPECT_NEAR(rgba.a, 128 / 255.0, 5e-4);
}

TEST(Texels, one_channel_is_grey_and_two_are_grey_and_alpha) {
  EXPECT_NEAR(half4(kuafu::linear_texels(texture(1, false, {51})), 0).b, 0.2, 2e-4);
  const glm::vec4 rgba = half4(kuafu::linear_texels(texture(2, false, {51, 102})), 0);
  EXPECT_NEAR(rgba.g, 0.2, 2e-4);
  EXPECT_NEAR(rgba.a, 0.4, 4e-4);
}

TEST(Texels, floats_stay_exact) {
  kuafu::Texture t;
  t.format = kuafu::Texture::Format::f32;
  t.width = t.height = 1;
  t.channels = 3;
  const float values[3] = {1e6f, 0.1f, 3e-9f};
  t.texels.resize(sizeof values);
  std::memcpy(t.texels.data(), values, sizeof values);
  const kuafu::Texels out = kuafu::linear_texels(t);
  ASSERT_EQ(out.format, kuafu::texel_float4);
  EXPECT_EQ(std::memcmp(out.words.data(), values, sizeof values), 0);
}

TEST(Texels, a_pattern_is_red_as_stored) {
  const kuafu::PatternPlane plane = kuafu::pattern_plane(texture(3, true, {128, 1, 2, 255, 3, 4}));
  EXPECT_EQ(plane.bits, 8u);
  ASSERT_EQ(plane.words.size(), 1u);
  EXPECT_EQ(plane.words[0], 128u | 255u << 8);
}

}  // namespace
