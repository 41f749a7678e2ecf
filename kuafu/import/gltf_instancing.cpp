// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_mesh.h"

#include <algorithm>
#include <glm/gtc/quaternion.hpp>

#include "device/error.h"
#include "import/gltf_accessor.h"

namespace kuafu {
namespace {

constexpr uint64_t bytes_per_copy = 1024;  // what an instance in the scene takes, and more

/// Values of one attribute, `width` of each copy; empty where it is not there.
std::vector<float> attribute(Import& import, const tinygltf::Model& model, const tinygltf::Value& attributes, const char* name, int width,
                             const std::string& field) {
  if (!attributes.IsObject() || !attributes.Has(name)) return {};
  return read_floats(import.budget, model, attributes.Get(name).GetNumberAsInt(), width, field + "." + name);
}

}  // namespace

std::vector<glm::dmat4> gpu_instances(Import& import, const tinygltf::Model& model, const tinygltf::Node& node, const std::string& field) {
  const auto found = node.extensions.find("EXT_mesh_gpu_instancing");
  if (found == node.extensions.end()) return {glm::dmat4(1.0)};
  const std::string user = field + ".extensions.EXT_mesh_gpu_instancing.attributes";
  if (!found->second.Has("attributes")) ks::fail(KS_ERROR_FILE, "%s is missing", user.c_str());
  const tinygltf::Value& attributes = found->second.Get("attributes");
  const std::vector<float> places = attribute(import, model, attributes, "TRANSLATION", 3, user),
                           turns = attribute(import, model, attributes, "ROTATION", 4, user),
                           scales = attribute(import, model, attributes, "SCALE", 3, user);
  const size_t count = std::max({places.size() / 3, turns.size() / 4, scales.size() / 3});
  const auto fits = [&](size_t values, size_t width) { return values == 0 || values == count * width; };
  if (!fits(places.size(), 3) || !fits(turns.size(), 4) || !fits(scales.size(), 3))
    ks::fail(KS_ERROR_FILE, "%s: %zu of TRANSLATION, %zu of ROTATION, %zu of SCALE, must be as many", user.c_str(), places.size() / 3,
             turns.size() / 4, scales.size() / 3);
  import.budget.claim(count * bytes_per_copy, user);
  std::vector<glm::dmat4> out(count, glm::dmat4(1.0));
  for (size_t i = 0; i < count; ++i) {
    if (!turns.empty()) {
      const glm::dquat q(turns[4 * i + 3], turns[4 * i], turns[4 * i + 1], turns[4 * i + 2]);
      if (!(glm::length(q) > 0.5)) ks::fail(KS_ERROR_FILE, "%s.ROTATION %zu has length %g, must be 1", user.c_str(), i, glm::length(q));
      out[i] = glm::mat4_cast(glm::normalize(q));
    }
    for (int axis = 0; axis < 3 && !scales.empty(); ++axis) out[i][axis] *= scales[3 * i + static_cast<size_t>(axis)];
    if (!places.empty()) out[i][3] = glm::dvec4(places[3 * i], places[3 * i + 1], places[3 * i + 2], 1.0);
  }
  return out;
}

}  // namespace kuafu
