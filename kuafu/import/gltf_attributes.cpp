// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_attributes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

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

}  // namespace kuafu
