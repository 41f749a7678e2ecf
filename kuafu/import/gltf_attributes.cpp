// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_attributes.h"

#include <algorithm>
#include <numeric>

#include "import/gltf_accessor.h"

namespace kuafu {

GltfAttributes::GltfAttributes(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, const std::string& field)
    : import_(import),
      model_(model),
      primitive_(primitive),
      field_(field),
      draco_(DracoPrimitive::decode(import.budget, model, primitive, field)) {}

std::vector<float> GltfAttributes::floats(const std::string& name, int components) const {
  const std::string user = field_ + ".attributes." + name;
  return draco_ && draco_->has(name) ? draco_->floats(name, components, user)
                                     : read_floats(import_.budget, model_, accessor(name), components, user);
}

std::vector<glm::vec4> GltfAttributes::colors() const {
  if (!has("COLOR_0")) return {};
  const size_t width = is_rgb("COLOR_0") ? 3 : 4;
  const std::vector<float> values = floats("COLOR_0", static_cast<int>(width));
  std::vector<glm::vec4> out;
  out.reserve(values.size() / width);
  for (size_t i = 0; i < values.size(); i += width)
    out.emplace_back(glm::max(glm::vec4(values[i], values[i + 1], values[i + 2], width == 3 ? 1.0f : values[i + 3]), glm::vec4(0.0f)));
  if (std::all_of(out.begin(), out.end(), [](const glm::vec4& c) { return c == glm::vec4(1.0f); })) out.clear();
  return out;
}

std::vector<uint32_t> GltfAttributes::indices(size_t vertex_count) const {
  if (draco_) return draco_->indices();
  if (primitive_.indices >= 0) return read_indices(import_.budget, model_, primitive_.indices, field_ + ".indices");
  import_.budget.claim(vertex_count * sizeof(uint32_t), field_);
  std::vector<uint32_t> out(vertex_count);
  std::iota(out.begin(), out.end(), 0u);
  return out;
}

int GltfAttributes::accessor(const std::string& name) const {
  const auto found = primitive_.attributes.find(name);
  return found == primitive_.attributes.end() ? -1 : found->second;
}

bool GltfAttributes::is_rgb(const std::string& name) const {
  if (draco_ && draco_->has(name)) return draco_->components(name) == 3;
  const auto index = static_cast<size_t>(accessor(name));
  return index < model_.accessors.size() && model_.accessors[index].type == TINYGLTF_TYPE_VEC3;
}

}  // namespace kuafu
