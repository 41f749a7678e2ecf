// SPDX-License-Identifier: Apache-2.0
#include "rig/rotation.h"

#include <algorithm>
#include <cmath>

namespace simsense {
namespace {

Vector3 row(const Rotation& m, size_t i) { return {m[3 * i], m[3 * i + 1], m[3 * i + 2]}; }

double dot(const Vector3& a, const Vector3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vector3 scaled(const Vector3& v, double factor) { return {v[0] * factor, v[1] * factor, v[2] * factor}; }

/// The inverse, transposed: its rows are the cross products of the matrix' other rows, over the determinant.
Rotation inverse_transposed(const Rotation& m) {
  const Vector3 a = row(m, 0), b = row(m, 1), c = row(m, 2), bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);
  const double determinant = dot(a, bc);
  Rotation out;
  for (size_t j = 0; j < 3; ++j) {
    out[j] = bc[j] / determinant;
    out[3 + j] = ca[j] / determinant;
    out[6 + j] = ab[j] / determinant;
  }
  return out;
}

/// The axis of a half turn, where the antisymmetric part of r vanishes: r + 1 is twice the axis times itself.
Vector3 axis_of_half_turn(const Rotation& r) {
  size_t i = 0;
  for (size_t k = 1; k < 3; ++k)
    if (r[4 * k] > r[4 * i]) i = k;
  Vector3 axis = row(r, i);
  axis[i] += 1;
  return scaled(axis, 1 / length(axis));
}

}  // namespace

Rotation multiply(const Rotation& a, const Rotation& b) {
  Rotation out{};
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  return out;
}

Vector3 multiply(const Rotation& r, const Vector3& v) { return {dot(row(r, 0), v), dot(row(r, 1), v), dot(row(r, 2), v)}; }

Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double length(const Vector3& v) { return std::sqrt(dot(v, v)); }

Rotation rotation_about(const Vector3& axis_angle) {
  const double angle = length(axis_angle);
  if (angle == 0) return {1, 0, 0, 0, 1, 0, 0, 0, 1};
  const Vector3 u = scaled(axis_angle, 1 / angle);
  const double c = std::cos(angle), s = std::sin(angle);
  const Rotation across{0, -u[2], u[1], u[2], 0, -u[0], -u[1], u[0], 0};
  Rotation out;
  for (size_t i = 0; i < 3; ++i)
    for (size_t j = 0; j < 3; ++j) out[3 * i + j] = (i == j ? c : 0) + (1 - c) * u[i] * u[j] + s * across[3 * i + j];
  return out;
}

Vector3 axis_angle_of(const Rotation& r) {
  const Vector3 twice_sine{r[7] - r[5], r[2] - r[6], r[3] - r[1]};
  const double sine = 0.5 * length(twice_sine), angle = rotation_angle(r);
  if (sine > 1e-8) return scaled(twice_sine, 0.5 * angle / sine);
  return angle < 1 ? scaled(twice_sine, 0.5) : scaled(axis_of_half_turn(r), angle);
}

Rotation nearest_rotation(const Rotation& matrix) {
  Rotation q = matrix;
  for (int step = 0; step < 30; ++step) {
    const Rotation other = inverse_transposed(q);
    double change = 0;
    for (size_t i = 0; i < 9; ++i) {
      const double next = 0.5 * (q[i] + other[i]);
      change = std::max(change, std::abs(next - q[i]));
      q[i] = next;
    }
    if (change < 1e-15) break;
  }
  return q;
}

}  // namespace simsense
