// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_tangents.h"

#include <cmath>

#include "device/error.h"

namespace kuafu {
namespace {

bool follows_tangents(const tinygltf::Model& model, int index) {
  if (index < 0 || static_cast<size_t>(index) >= model.materials.size()) return false;
  const tinygltf::Material& m = model.materials[static_cast<size_t>(index)];
  return m.normalTexture.index >= 0 || m.extensions.contains("KHR_materials_anisotropy");
}

/// 0, which is none, where the file has no direction.
glm::vec4 unit(const glm::vec4& t) {
  const float length = glm::length(glm::vec3(t));
  if (!(length > 0.0f) || !std::isfinite(length)) return glm::vec4(0.0f);
  return {glm::vec3(t) / length, t.w < 0.0f ? -1.0f : 1.0f};
}

}  // namespace

std::vector<glm::vec4> read_tangents(const GltfAttributes& attributes, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                     size_t vertex_count, const std::string& field) {
  if (!attributes.has("NORMAL") || !follows_tangents(model, primitive.material)) return {};
  std::vector<glm::vec4> tangents = attributes.vectors<glm::vec4>("TANGENT");
  if (!tangents.empty() && tangents.size() != vertex_count)
    ks::fail(KS_ERROR_FILE, "%s.attributes: %zu positions, %zu of TANGENT", field.c_str(), vertex_count, tangents.size());
  for (glm::vec4& t : tangents) t = unit(t);
  return tangents;
}

}  // namespace kuafu
