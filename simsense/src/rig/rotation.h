// SPDX-License-Identifier: Apache-2.0
// Rotations in three dimensions: products, the axis and angle of a rotation (Rodrigues), and the rotation nearest to a matrix.
// Thread rule: pure functions.
#pragma once

#include "rig/rig.h"

namespace simsense {

using Vector3 = std::array<double, 3>;

Rotation multiply(const Rotation& a, const Rotation& b);
Vector3 multiply(const Rotation& r, const Vector3& v);
Vector3 cross(const Vector3& a, const Vector3& b);
double length(const Vector3& v);

/// Returns the rotation about this axis by its length, radians (Rodrigues 1840).
Rotation rotation_about(const Vector3& axis_angle);
/// Returns the axis of a rotation, with the angle, 0..pi, as its length.
Vector3 axis_angle_of(const Rotation& rotation);
/// Returns the nearest rotation to a matrix of few digits: the orthogonal factor of the polar decomposition, by Newton's iteration (Higham,
/// Computing the polar decomposition, SIAM J. Sci. Stat. Comput. 7(4), 1986).
Rotation nearest_rotation(const Rotation& matrix);

}  // namespace simsense
