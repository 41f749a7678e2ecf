// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_attributes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "device/error.h"
#include "import/gltf_accessor.h"

namespace kuafu {
namespace {

constexpr double bounds_rounding = 1e-4;  // of the largest value: exporters write bounds with few digits

/// A file whose bounds are not those of its data was cut or mixed up on its way: other readers place things by them.
void warn_of_bounds(Import& import, const tinygltf::Accessor& accessor, const std::vector<float>& values, const std::string& user) {
  const size_t width = accessor.minValues.size();
  if (accessor.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT || values.empty() || accessor.maxValues.size() != width ||
      width * accessor.count != values.size())
    return;
  for (size_t c = 0; c < width; ++c) {
    double low = values[c], high = values[c];
    for (size_t i = c; i < values.size(); i += width) low = std::min<double>(low, values[i]), high = std::max<double>(high, values[i]);
    const double least = accessor.minValues[c], most = accessor.maxValues[c];
    const double allowed = bounds_rounding * std::max({std::abs(low), std::abs(high), 1e-6});
    if (std::abs(low - least) <= allowed && std::abs(high - most) <= allowed) continue;
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(), ": component %zu goes from %g to %g, but the accessor's min and max say %g to %g", c, low, high,
                  least, most);
    import.warn(user + text.data());
    return;
  }
}

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

GltfAttributes::GltfAttributes(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, const std::string& field)
    : import_(import),
      model_(model),
      primitive_(primitive),
      field_(field),
      draco_(DracoPrimitive::decode(import.budget, model, primitive, field)) {}

std::vector<float> GltfAttributes::floats(const std::string& name, int components) const {
  const std::string user = field_ + ".attributes." + name;
  if (draco_ && draco_->has(name)) return draco_->floats(name, components, user);
  std::vector<float> values = read_floats(import_.budget, model_, accessor(name), components, user);
  warn_of_bounds(import_, model_.accessors[static_cast<size_t>(accessor(name))], values, user);
  return values;
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
