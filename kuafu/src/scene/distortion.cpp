// SPDX-License-Identifier: Apache-2.0
#include "scene/distortion.h"

#include <cmath>

#include "shared/lens_record.h"

namespace kuafu {
namespace {

struct Mapped {
  glm::dvec2 at;
  double xx, xy, yy;  // Jacobian, which is symmetric
  /// Growing in every direction: where this holds from the axis outwards, no two rays meet in one pixel.
  [[nodiscard]] bool grows() const { return xx + yy > 0.0 && xx * yy > xy * xy; }
};

Mapped map_brown_conrady(const std::array<double, 8>& k, const glm::dvec2& p) {
  const double x = p.x, y = p.y, r2 = x * x + y * y;
  const double over = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])), under = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
  const double g = over / under;
  const double slope = (k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]) - g * (k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]))) / under;  // dg / dr^2
  const double p1 = k[2], p2 = k[3];
  return {{x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x), y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y},
          g + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x,
          2 * x * y * slope + 2 * p1 * x + 2 * p2 * y,
          g + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x};
}

/// The distorted radius at an angle from the axis, and its derivative.
glm::dvec2 fisheye_radius(const std::array<double, 8>& k, double angle) {
  const double a2 = angle * angle;
  return {angle * (1 + a2 * (k[0] + a2 * (k[1] + a2 * (k[2] + a2 * k[3])))),
          1 + a2 * (3 * k[0] + a2 * (5 * k[1] + a2 * (7 * k[2] + a2 * 9 * k[3])))};
}

Mapped map_fisheye(const std::array<double, 8>& k, const glm::dvec2& p) {
  const double r2 = glm::dot(p, p), r = std::sqrt(r2);
  const glm::dvec2 seen = fisheye_radius(k, std::atan(r));
  const double g = r > 1e-8 ? seen.x / r : 1, slope = seen.y / (1 + r2), bend = r > 1e-8 ? (slope - g) / r2 : 0;
  return {p * g, g + p.x * p.x * bend, p.x * p.y * bend, g + p.y * p.y * bend};
}

Mapped map(const Distortion& lens, const glm::dvec2& p) {
  return lens.model == lens_kannala_brandt ? map_fisheye(lens.k, p) : map_brown_conrady(lens.k, p);
}

/// Newton's steps, as the stages take them. Nothing at 90 degrees from the axis and beyond.
std::optional<glm::dvec2> undistort_fisheye(const std::array<double, 8>& k, const glm::dvec2& distorted) {
  const double radius = glm::length(distorted);
  double angle = radius;
  for (uint32_t i = 0; i < undistort_steps; ++i) {
    const glm::dvec2 seen = fisheye_radius(k, angle);
    if (std::abs(seen.x - radius) < 1e-9)
      return std::abs(angle) < 1.57 ? std::optional(distorted * (angle > 1e-9 ? std::tan(angle) / radius : 1)) : std::nullopt;
    angle -= (seen.x - radius) / seen.y;
  }
  return std::nullopt;
}

/// Newton's steps from the distorted point, as the stages take them.
std::optional<glm::dvec2> undistort(const Distortion& lens, const glm::dvec2& distorted) {
  if (lens.model == lens_kannala_brandt) return undistort_fisheye(lens.k, distorted);
  glm::dvec2 p = distorted;
  for (uint32_t i = 0; i < undistort_steps; ++i) {
    const Mapped m = map(lens, p);
    const glm::dvec2 e = m.at - distorted;
    if (glm::dot(e, e) < 1e-13) return p;
    const double determinant = m.xx * m.yy - m.xy * m.xy;
    p -= glm::dvec2(m.yy * e.x - m.xy * e.y, m.xx * e.y - m.xy * e.x) / determinant;
  }
  return std::nullopt;  // NaN ends here too
}

/// Distorted radius up to which the lens grows in this direction.
double reach(const Distortion& lens, const glm::dvec2& direction, double most) {
  constexpr int steps = 4096;
  double farthest = 0.0;
  for (int i = 0; i <= steps; ++i) {
    const Mapped m = map(lens, direction * (4.0 * most * i / steps));
    if (!m.grows()) break;
    farthest = glm::length(m.at);
  }
  return farthest;
}

bool reachable(const Distortion& lens, const glm::dvec2& distorted) {
  constexpr int steps = 16;
  for (int i = 1; i <= steps; ++i)
    if (!undistort(lens, distorted * (double(i) / steps))) return false;
  const glm::dvec2 end = *undistort(lens, distorted);
  for (int i = 0; i <= 2 * steps; ++i)
    if (!map(lens, end * (i / (2.0 * steps))).grows()) return false;
  return true;
}

}  // namespace

glm::dvec2 distort(const Distortion& lens, const glm::dvec2& ideal) { return map(lens, ideal).at; }

std::optional<Fold> find_fold(const Distortion& lens, const glm::dmat3& camera_k, uint32_t width, uint32_t height) {
  constexpr int per_side = 16;
  const glm::dmat3 to_image = glm::inverse(camera_k);
  for (int i = 0; i < 4 * per_side; ++i) {
    const double along = double(i % per_side) / per_side;
    const int side = i / per_side;  // top, right, bottom, left
    const glm::dvec2 corner[5] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}, {0, 0}};
    const glm::dvec2 pixel = glm::mix(corner[side], corner[side + 1], along) * glm::dvec2(width, height) - 0.5;
    const glm::dvec2 distorted(to_image * glm::dvec3(pixel, 1.0));
    if (reachable(lens, distorted)) continue;
    const double needed = glm::length(distorted);
    return Fold{pixel, reach(lens, distorted / needed, needed), needed};
  }
  return std::nullopt;
}

}  // namespace kuafu
