// SPDX-License-Identifier: Apache-2.0
#include "scene/motion.h"

#include <cmath>

namespace kuafu {
namespace {

glm::dmat3 cross_matrix(const glm::dvec3& w) { return {0.0, w.z, -w.y, -w.z, 0.0, w.x, w.y, -w.x, 0.0}; }

/// Nearest rotation of an invertible matrix, by Newton's iteration (Higham, "Computing the Polar Decomposition", 1986).
glm::dmat3 rotation_of(const glm::dmat3& linear) {
  glm::dmat3 r = linear;
  for (int i = 0; i < 100; ++i) {
    const glm::dmat3 inverse_transpose = glm::transpose(glm::inverse(r));
    // Scaled so that a matrix far from a rotation comes near in few steps.
    double size = 0.0, inverse_size = 0.0;
    for (int c = 0; c < 3; ++c) size += glm::dot(r[c], r[c]), inverse_size += glm::dot(inverse_transpose[c], inverse_transpose[c]);
    const double scale = std::pow(inverse_size / size, 0.25);
    const glm::dmat3 next = 0.5 * (scale * r + inverse_transpose / scale);
    double change = 0.0;
    for (int c = 0; c < 3; ++c) change += glm::dot(next[c] - r[c], next[c] - r[c]);
    r = next;
    if (change < 1e-28) break;
  }
  return glm::determinant(r) < 0.0 ? -r : r;
}

}  // namespace

glm::dmat4 Motion::at(double seconds) const {
  const glm::dvec3 angle = angular * seconds;
  const double a2 = glm::dot(angle, angle), a = std::sqrt(a2);
  // Exponential map of SE(3) (Murray, Li and Sastry 1994, 2.36), with series where the closed forms cancel.
  const bool small = a2 < 1e-4;
  const double sine = small ? 1.0 - a2 / 6.0 + a2 * a2 / 120.0 : std::sin(a) / a;
  const double cosine = small ? 0.5 - a2 / 24.0 + a2 * a2 / 720.0 : (1.0 - std::cos(a)) / a2;
  const double cubic = small ? 1.0 / 6.0 - a2 / 120.0 + a2 * a2 / 5040.0 : (1.0 - sine) / a2;
  const glm::dmat3 k = cross_matrix(angle), k2 = k * k, one(1.0);
  const glm::dmat3 rotation = one + sine * k + cosine * k2;
  const glm::dvec3 path = (one + cosine * k + cubic * k2) * (linear * seconds);
  glm::dmat4 m(rotation);
  m[3] = glm::dvec4(pivot + path - rotation * pivot, 1.0);
  return m;
}

double Motion::speed(double radius_m) const { return glm::length(linear) + glm::length(angular) * radius_m; }

Motion world_motion(const glm::dmat4& pose, const Twist& twist) {
  const glm::dmat3 axes = rotation_of(glm::dmat3(pose));
  return {glm::dvec3(pose[3]), axes * twist.linear, axes * twist.angular};
}

}  // namespace kuafu
