// SPDX-License-Identifier: Apache-2.0
// What each part of a scene must be on its own: finite, in range, of matching sizes. References between parts are Scene's to check.
// Every function throws ks::Error (KS_ERROR_INVALID_ARGUMENT) that names the part, the field and the numbers. Thread rule: pure functions.
#pragma once

#include "scene/scene.h"

namespace kuafu {

void check(const Mesh& mesh);
/// Of the mesh of that name: finite positions, unit normals.
void check_vertices(const std::string& mesh, const std::vector<glm::vec3>& positions, const std::vector<glm::vec3>& normals);
void check(const Texture& texture);
/// Bytes of the texels of a texture of this size and format; throws for a size or channel count out of range.
uint64_t texel_bytes(const Texture& texture);
void check(const Material& material);
void check(const Light& light);
/// Finite, at most 1e6 m/s and rad/s; `what` and `name` are the owner's.
void check_velocity(const char* what, const std::string& name, const Twist& velocity);
void check(const Environment& environment);
/// width and height may be 0: a camera whose image size is not known yet.
void check(const Medium& medium);
void check(const Camera& camera);
/// Every pixel of the image has one ray: the distortion does not fold back before the image ends.
void check_undistortable(const Camera& camera);
/// Finite, affine (last row 0 0 0 1) and invertible.
void check_affine(const glm::dmat4& matrix, const char* what);
/// check_affine, and a proper rotation: columns of unit length and orthogonal within 1e-4, determinant > 0.
void check_rigid(const glm::dmat4& matrix, const char* what);

}  // namespace kuafu
