// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_vertices.h"

#include <cmath>

#include "device/error.h"
#include "import/gltf_accessor.h"

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

/// Files round their weights; a vertex without any hangs on its first joint.
void normalise(std::vector<SkinWeights>& sets, size_t vertex_count) {
  for (size_t i = 0; i < vertex_count; ++i) {
    float sum = 0.0f;
    for (const SkinWeights& set : sets) sum += set.weights[i][0] + set.weights[i][1] + set.weights[i][2] + set.weights[i][3];
    for (SkinWeights& set : sets) set.weights[i] = sum != 0.0f ? set.weights[i] / sum : glm::vec4(0.0f);
    if (sum == 0.0f) sets[0].weights[i][0] = 1.0f;
  }
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

std::vector<SkinWeights> read_skin_weights(const GltfAttributes& attributes, size_t vertex_count, const std::string& field) {
  std::vector<SkinWeights> sets;
  for (size_t n = 0;; ++n) {
    const std::string joints = "JOINTS_" + std::to_string(n), weights = "WEIGHTS_" + std::to_string(n);
    if (!attributes.has(joints) || !attributes.has(weights)) break;
    SkinWeights set;
    for (const glm::vec4& j : attributes.vectors<glm::vec4>(joints))
      set.joints.emplace_back(glm::min(glm::max(glm::vec4(0.0f), j), glm::vec4(65535.0f)));
    set.weights = attributes.vectors<glm::vec4>(weights);
    if (set.joints.size() != vertex_count || set.weights.size() != vertex_count)
      ks::fail(KS_ERROR_FILE, "%s.attributes: %zu positions, %zu of %s, %zu of %s", field.c_str(), vertex_count, set.joints.size(),
               joints.c_str(), set.weights.size(), weights.c_str());
    sets.push_back(std::move(set));
  }
  if (!sets.empty()) normalise(sets, vertex_count);
  return sets;
}

std::vector<MorphTarget> read_targets(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                      size_t vertex_count, bool tangents, const std::string& field) {
  std::vector<MorphTarget> out;
  for (size_t t = 0; t < primitive.targets.size(); ++t) {
    MorphTarget target;
    for (const auto& [name, accessor] : primitive.targets[t]) {
      const std::string user = std::string(field).append(".targets[").append(std::to_string(t)).append("].").append(name);
      std::vector<glm::vec3>* to = name == "POSITION" ? &target.positions : name == "NORMAL" ? &target.normals : nullptr;
      if (name == "TANGENT") {
        if (!tangents) continue;
        to = &target.tangents;
      }
      if (to == nullptr) {
        import.warn(field + ": of morph targets, " + clean_name(name) + " is ignored");
        continue;
      }
      *to = as_vectors<glm::vec3>(read_floats(import.budget, model, accessor, 3, user));
      if (to->size() != vertex_count) ks::fail(KS_ERROR_FILE, "%s: %zu values for %zu positions", user.c_str(), to->size(), vertex_count);
    }
    out.push_back(std::move(target));
  }
  return out;
}

}  // namespace kuafu
