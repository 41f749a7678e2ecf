// SPDX-License-Identifier: Apache-2.0
// Checks of each part of a scene on its own: finite, in range, of matching sizes. Scene checks references between parts. Every function
// throws ks::Error (KS_ERROR_INVALID_ARGUMENT) with the part, the field and the numbers. Thread rule: pure functions.
#pragma once

#include "scene/scene.h"

namespace kuafu {

void check(const Mesh& mesh);
/// Throws unless the named mesh's positions are finite and its normals are unit vectors.
void check_vertices(const std::string& mesh, const std::vector<glm::vec3>& positions, const std::vector<glm::vec3>& normals);
void check(const Texture& texture);
/// Returns the bytes of a texture's texels; throws for a size or channel count out of range.
uint64_t texel_bytes(const Texture& texture);
void check(const Material& material);
void check(const Light& light);
/// Throws unless the velocity is finite and at most 1e6 m/s and rad/s. `what` and `name` name its owner.
void check_velocity(const char* what, const std::string& name, const Twist& velocity);
void check(const Environment& environment);
/// Throw for invalid fields. A camera's width and height may be 0: a file's camera has no image size.
void check(const Medium& medium);
void check(const Camera& camera);
/// Throws unless every pixel of the image has one ray: the distortion must not fold back before the image ends.
void check_undistortable(const Camera& camera);
/// Throws unless the matrix is finite, affine (last row 0 0 0 1) and invertible.
void check_affine(const glm::dmat4& matrix, const char* what);
/// Throws unless the matrix is affine and a proper rotation: columns of unit length and orthogonal within 1e-4, determinant > 0.
void check_rigid(const glm::dmat4& matrix, const char* what);

}  // namespace kuafu
