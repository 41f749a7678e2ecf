// SPDX-License-Identifier: Apache-2.0
// Converts the C API's plain structs to the scene's types and back. Scene validates their content.
#pragma once

#include <algorithm>
#include <glm/glm.hpp>

#include "api/fields.h"
#include "ks/lens.h"
#include "scene/distortion.h"

namespace kuafu {

// Between the C API's row-major matrices and glm's column-major ones.
template <int N>
glm::mat<N, N, double> from_row_major(const double* rows) {
  glm::mat<N, N, double> m;
  for (int r = 0; r < N; ++r)
    for (int c = 0; c < N; ++c) m[c][r] = rows[N * r + c];
  return m;
}

template <int N>
void to_row_major(const glm::mat<N, N, double>& m, double* rows) {
  for (int r = 0; r < N; ++r)
    for (int c = 0; c < N; ++c) rows[N * r + c] = m[c][r];
}

inline Distortion to_distortion(const ks_lens& lens) {
  Distortion out{lens.model, {}};
  std::ranges::copy(lens.distortion, out.k.begin());
  return out;
}

inline ks_lens to_lens(const Distortion& distortion) {
  ks_lens out{.model = distortion.model, .reserved = 0, .distortion = {}};
  std::ranges::copy(distortion.k, out.distortion);
  return out;
}

/// Converts an array [count][3] to vectors; NULL gives none.
std::vector<glm::vec3> to_vectors(const float* values, uint32_t count);
/// Converts velocities, [3] each, m/s and rad/s.
Twist to_twist(const double* linear, const double* angular);
Mesh to_mesh(const kuafu_mesh_desc& desc);
Texture to_texture(const kuafu_texture_desc& desc);
Instance to_instance(const kuafu_instance_desc& desc);
Light to_light(const kuafu_light_desc& desc);
/// Converts a struct to a Material, Environment, Medium or Camera, which has the same fields.
template <class Record, class Desc>
Record copied(const Desc& desc) {
  Record out;
  copy_fields(desc, out);
  return out;
}

/// Converts a mesh to its struct. The name and arrays point into the mesh.
kuafu_mesh_desc to_desc(const Mesh& mesh);
kuafu_texture_desc to_desc(const Texture& texture);
/// Converts an instance to its struct, without materials: the caller's ids differ, so their array is not the instance's.
kuafu_instance_desc to_desc(const Instance& instance);
kuafu_material_desc to_desc(const Material& material);
kuafu_light_desc to_desc(const Light& light);
kuafu_camera_desc to_desc(const Camera& camera);

}  // namespace kuafu
