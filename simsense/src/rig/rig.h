// SPDX-License-Identifier: Apache-2.0
// The stereo rig as the stages use it: pinholes, rigid transforms, and the checks of a simsense_rig_desc.
#pragma once

#include <array>
#include <cstdint>

#include "simsense/simsense.h"

namespace simsense {

struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

using Rotation = std::array<double, 9>;  // row-major 3x3

/// A rigid motion: to = rotation * from + translation (metres).
struct Rigid {
  Rotation rotation{1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> translation{};
};

Pinhole pinhole(const simsense_camera& camera);
/// Whether the lens differs from an ideal pinhole.
bool is_distorting(const ks_lens& lens);
Rigid rigid(const double matrix[16]);
/// Returns c with c(x) = a(b(x)).
Rigid compose(const Rigid& a, const Rigid& b);
Rotation transposed(const Rotation& r);
/// Angle of a rotation, radians.
double rotation_angle(const Rotation& r);

/// Throws KS_ERROR_INVALID_ARGUMENT for an invalid rig, with the field and its value.
void check_rig(const simsense_rig_desc& rig);

}  // namespace simsense
