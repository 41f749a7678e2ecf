// SPDX-License-Identifier: Apache-2.0
// Stereo pairs made for the tests: random dots seen at one disparity, with noise.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "match/detection.h"
#include "match/matcher.h"

struct StereoPair {
  uint32_t width, height;
  std::vector<uint8_t> left, right;
  simsense::DetectionNoise noise{0, 0, 0, 1};
};

inline simsense::MatchParameters searching(uint32_t disparities, uint32_t block = 1) {
  simsense::MatchParameters p;
  p.max_disparity = disparities;
  p.block_width = p.block_height = block;
  return p;
}

/// A random texture; the left image shows it `shift` pixels further right than the right image does. Noise: uniform, +- `noise` counts.
inline StereoPair random_dots(uint32_t width, uint32_t height, uint32_t shift, uint32_t noise, uint32_t seed) {
  std::mt19937 random(seed);
  const auto uniform = [&](int low, int high) { return low + static_cast<int>(random() % static_cast<uint32_t>(high - low + 1)); };
  const size_t texture_width = width + shift;
  std::vector<int> texture(texture_width * height);
  for (int& value : texture) value = uniform(0, 3) == 0 ? uniform(100, 255) : uniform(0, 60);
  StereoPair pair{width, height, {}, {}, {0, 0, 0, 1}};
  const auto seen = [&](int value) {
    const int n = static_cast<int>(noise);
    return static_cast<uint8_t>(std::clamp(value + uniform(-n, n), 0, 255));
  };
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      pair.left.push_back(seen(texture[y * texture_width + x]));
      pair.right.push_back(seen(texture[y * texture_width + x + shift]));
    }
  }
  return pair;
}

inline std::vector<float> match(simsense::Matcher& matcher, const StereoPair& pair) {
  std::vector<float> disparity(size_t{pair.width} * pair.height, 12345.0f);
  const ptrdiff_t stride = pair.width;
  matcher.set_noise(pair.noise);
  matcher.match({pair.left.data(), stride}, {pair.right.data(), stride}, disparity.data());
  return disparity;
}

struct Match {
  std::vector<float> disparity, confidence;
  std::vector<simsense::MatchReason> reason;
};

/// All maps. wide: the images as 16-bit ones, brighter by a factor that no census sees.
inline Match match_all(simsense::Matcher& matcher, const StereoPair& pair, bool wide = false) {
  const size_t pixels = size_t{pair.width} * pair.height;
  Match maps{std::vector<float>(pixels, 12345.0f), std::vector<float>(pixels, 12345.0f), std::vector<simsense::MatchReason>(pixels)};
  simsense::MatchMaps out = maps.disparity.data();
  out.confidence = maps.confidence.data();
  out.reason = maps.reason.data();
  const ptrdiff_t stride = pair.width;
  std::vector<uint16_t> left(pair.left.begin(), pair.left.end()), right(pair.right.begin(), pair.right.end());
  for (auto* image : {&left, &right})
    for (uint16_t& value : *image) value = static_cast<uint16_t>(value * 257);
  const auto bytes = [](const std::vector<uint16_t>& image) { return reinterpret_cast<const uint8_t*>(image.data()); };
  matcher.set_noise(pair.noise);
  if (wide) {
    matcher.match({bytes(left), stride, 2}, {bytes(right), stride, 2}, out);
  } else {
    matcher.match({pair.left.data(), stride}, {pair.right.data(), stride}, out);
  }
  return maps;
}
