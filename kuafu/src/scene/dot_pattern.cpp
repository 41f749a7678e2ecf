// SPDX-License-Identifier: Apache-2.0
#include "scene/dot_pattern.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "device/error.h"
#include "scene/scene.h"

namespace kuafu {
namespace {

constexpr double reach_sigmas = 6;        // 2e-9 of a dot lies outside
constexpr double most_pixels = 1u << 31;  // that all dots touch together: seconds
constexpr uint32_t max_side = 1u << 15;

/// Integrals of a unit Gaussian over the pixels of one row or column that it reaches.
struct Profile {
  int first = 0;
  std::vector<double> shares;
};

Profile profile(double centre, double sigma, uint32_t size) {
  const double reach = reach_sigmas * sigma + 0.5;
  const double low = std::max(std::ceil(centre - reach), 0.0), high = std::min(std::floor(centre + reach), double(size) - 1);
  Profile p;
  if (!(low <= high)) return p;
  p.first = int(low);
  const double scale = 1 / (sigma * std::sqrt(2.0));
  double before = std::erf((low - 0.5 - centre) * scale);
  for (int i = int(low); i <= int(high); ++i) {
    const double after = std::erf((i + 0.5 - centre) * scale);
    p.shares.push_back((after - before) / 2);
    before = after;
  }
  return p;
}

}  // namespace

void check(const DotPattern& pattern, const std::string& light) {
  const char* name = light.c_str();
  if (pattern.width == 0 || pattern.height == 0 || pattern.width > max_side || pattern.height > max_side)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': pattern_width and pattern_height are %u and %u, must be in [1, %u]", name,
             pattern.width, pattern.height, max_side);
  if (!(pattern.sigma_px > 0.0f) || !std::isfinite(pattern.sigma_px))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': dot_sigma_px is %g, must be finite and > 0", name, double(pattern.sigma_px));
  for (size_t i = 0; i < pattern.dots.size(); ++i) {
    const glm::vec3& d = pattern.dots[i];
    if (!std::isfinite(d.x) || !std::isfinite(d.y) || !std::isfinite(d.z) || d.z < 0.0f)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': dots[%zu] is u %g, v %g, power %g; all must be finite and the power >= 0", name, i,
               double(d.x), double(d.y), double(d.z));
  }
  const double side = 2 * reach_sigmas * double(pattern.sigma_px) + 2;
  const double touched = double(pattern.dots.size()) * std::min(side, double(pattern.width)) * std::min(side, double(pattern.height));
  if (touched > most_pixels)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "light '%s': %zu dots of sigma %g pixels touch %g pixels in all, at most %g: give it as a texture",
             name, pattern.dots.size(), double(pattern.sigma_px), touched, most_pixels);
}

Texture rasterise(const DotPattern& pattern) {
  const size_t count = size_t(pattern.width) * pattern.height;
  std::vector<double> sums(count, pattern.background);
  for (const glm::vec3& dot : pattern.dots) {
    const Profile across = profile(dot.x, pattern.sigma_px, pattern.width), down = profile(dot.y, pattern.sigma_px, pattern.height);
    for (size_t r = 0; r < down.shares.size(); ++r) {
      double* row = sums.data() + (size_t(down.first) + r) * pattern.width + across.first;
      const double share = double(dot.z) * down.shares[r];
      for (size_t c = 0; c < across.shares.size(); ++c) row[c] += share * across.shares[c];
    }
  }
  Texture texture;
  texture.name = "dots";
  texture.width = pattern.width;
  texture.height = pattern.height;
  texture.channels = 1;
  texture.format = Texture::Format::f32;
  const std::vector<float> values(sums.begin(), sums.end());
  texture.texels.resize(count * sizeof(float));
  std::memcpy(texture.texels.data(), values.data(), texture.texels.size());
  return texture;
}

}  // namespace kuafu
