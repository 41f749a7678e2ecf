// SPDX-License-Identifier: Apache-2.0
#include "material/texels.h"

#include <array>
#include <cmath>
#include <cstring>
#include <glm/gtc/packing.hpp>

#include "shared/scene_records.h"

namespace kuafu {
namespace {

float srgb_to_linear(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }

class TexelReader {
 public:
  explicit TexelReader(const Texture& texture) : texture_(texture) {}

  [[nodiscard]] float stored(size_t texel, uint32_t channel) const {
    const size_t i = texel * texture_.channels + channel;
    if (texture_.format == Texture::Format::u16) return float(at<uint16_t>(i)) / 65535.0f;
    return at<float>(i);
  }

  [[nodiscard]] glm::vec4 linear(size_t texel) const {
    const uint32_t n = texture_.channels;
    const bool has_alpha = n == 2 || n == 4;
    glm::vec4 rgba(1.0f);
    for (uint32_t c = 0; c < 3; ++c) rgba[int(c)] = colour(texel, n >= 3 ? c : 0);
    if (has_alpha) rgba.a = stored(texel, n - 1);
    return rgba;
  }

 private:
  template <class T>
  [[nodiscard]] T at(size_t i) const {
    T value;
    std::memcpy(&value, texture_.texels.data() + i * sizeof(T), sizeof(T));
    return value;
  }
  [[nodiscard]] float colour(size_t texel, uint32_t channel) const {
    return texture_.srgb ? srgb_to_linear(stored(texel, channel)) : stored(texel, channel);
  }

  const Texture& texture_;
};

/// Texels of 8 bits as halves, two a word, from a table of all that a byte may be.
std::vector<uint32_t> halves_of_bytes(const Texture& texture) {
  std::array<uint32_t, 256> colour, alpha;
  for (size_t i = 0; i < alpha.size(); ++i) {
    const float value = float(i) / 255.0f;
    alpha[i] = glm::packHalf1x16(value);
    colour[i] = glm::packHalf1x16(texture.srgb ? srgb_to_linear(value) : value);
  }
  const size_t n = texture.channels, green = n >= 3 ? 1 : 0, blue = 2 * green;
  const bool has_alpha = n == 2 || n == 4;
  std::vector<uint32_t> words(size_t(texture.width) * texture.height * 2);
  const unsigned char* texel = texture.texels.data();
  for (size_t i = 0; i < words.size(); i += 2, texel += n) {
    words[i] = colour[texel[0]] | colour[texel[green]] << 16;
    words[i + 1] = colour[texel[blue]] | alpha[has_alpha ? texel[n - 1] : 255] << 16;
  }
  return words;
}

}  // namespace

Texels linear_texels(const Texture& texture) {
  if (texture.format == Texture::Format::u8) return {halves_of_bytes(texture), texel_half4};
  const TexelReader reader(texture);
  const bool single = texture.format == Texture::Format::f32;
  const size_t count = size_t(texture.width) * texture.height;
  Texels out{{}, single ? texel_float4 : texel_half4};
  out.words.resize(count * (single ? 4 : 2));
  for (size_t i = 0; i < count; ++i) {
    const glm::vec4 rgba = reader.linear(i);
    if (single) {
      std::memcpy(&out.words[4 * i], &rgba, sizeof rgba);
    } else {
      out.words[2 * i] = glm::packHalf2x16({rgba.r, rgba.g});
      out.words[2 * i + 1] = glm::packHalf2x16({rgba.b, rgba.a});
    }
  }
  return out;
}

PatternPlane pattern_plane(const Texture& texture) {
  const size_t bytes = texture.format == Texture::Format::u8 ? 1 : texture.format == Texture::Format::u16 ? 2 : 4;
  const size_t count = size_t(texture.width) * texture.height;
  PatternPlane plane{std::vector<uint32_t>((count * bytes + 3) / 4), uint32_t(8 * bytes)};
  auto* to = reinterpret_cast<unsigned char*>(plane.words.data());
  for (size_t i = 0; i < count; ++i) std::memcpy(to + i * bytes, texture.texels.data() + i * texture.channels * bytes, bytes);
  return plane;
}

}  // namespace kuafu
