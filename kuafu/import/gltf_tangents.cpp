// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_tangents.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace kuafu {
namespace {

/// Whether the material turns with tangents that its first texture coordinates tell.
bool follows_tangents(const tinygltf::Model& model, int index) {
  if (index < 0 || static_cast<size_t>(index) >= model.materials.size()) return false;
  const tinygltf::Material& m = model.materials[static_cast<size_t>(index)];
  if (m.normalTexture.index >= 0) return m.normalTexture.texCoord == 0 && !m.normalTexture.extensions.contains("KHR_texture_transform");
  return m.extensions.contains("KHR_materials_anisotropy");
}

glm::vec3 flat_on(const glm::vec3& v, const glm::vec3& normal) { return v - normal * glm::dot(v, normal); }

double angle(const glm::vec3& a, const glm::vec3& b) {
  return std::acos(std::clamp(double(glm::dot(a, b)) / (double(glm::length(a)) * double(glm::length(b))), -1.0, 1.0));
}

}  // namespace

double degrees_off(const Mesh& mesh, const std::vector<glm::vec4>& tangents) {
  double sum = 0.0, weight = 0.0;
  for (const glm::uvec3& t : mesh.indices) {
    const glm::vec3 edge_1 = mesh.positions[t[1]] - mesh.positions[t[0]], edge_2 = mesh.positions[t[2]] - mesh.positions[t[0]];
    const glm::vec2 d_1 = mesh.uvs[t[1]] - mesh.uvs[t[0]], d_2 = mesh.uvs[t[2]] - mesh.uvs[t[0]];
    const float determinant = d_1.x * d_2.y - d_1.y * d_2.x;
    if (determinant == 0.0f) continue;
    const glm::vec3 growing_u = (edge_1 * d_2.y - edge_2 * d_1.y) / determinant,
                    growing_v = (edge_2 * d_1.x - edge_1 * d_2.x) / determinant;
    const double area = double(glm::length(glm::cross(edge_1, edge_2)));
    for (int k = 0; k < 3; ++k) {
      const glm::vec3 normal = mesh.normals[t[k]], file = flat_on(glm::vec3(tangents[t[k]]), normal), own = flat_on(growing_u, normal);
      const glm::vec3 file_up = glm::cross(normal, file) * tangents[t[k]].w, own_up = glm::cross(normal, own);
      const bool mirrored = glm::dot(own_up, growing_v) > 0.0f;  // v falls along the bitangent
      const double off = std::max(angle(file, own), angle(file_up, mirrored ? -own_up : own_up));
      if (!std::isfinite(off) || !std::isfinite(area)) continue;
      sum += area * off;
      weight += area;
    }
  }
  return weight > 0.0 ? sum / weight * 180.0 / std::numbers::pi : -1.0;
}

void judge_tangents(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, const Mesh& mesh,
                    const std::vector<glm::vec4>& tangents, const std::string& field) {
  if (tangents.size() != mesh.positions.size() || mesh.uvs.empty() || mesh.normals.empty() || !follows_tangents(model, primitive.material))
    return;
  constexpr double told = 5.0;
  const double degrees = degrees_off(mesh, tangents);
  if (degrees > told)
    import.warn(field + ": TANGENT is not read, and is " + std::to_string(std::lround(degrees)) +
                " degrees off the directions of its texture coordinates, which its normal map and anisotropy follow");
}

}  // namespace kuafu
