// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

#include "device/error.h"
#include "import/gltf_accessor.h"
#include "import/gltf_draco.h"

namespace kuafu {
namespace {

template <class Vector>
std::vector<Vector> as_vectors(const std::vector<float>& values) {
  std::vector<Vector> out(values.size() / static_cast<size_t>(Vector::length()));
  if (!out.empty()) std::memcpy(static_cast<void*>(out.data()), values.data(), out.size() * sizeof(Vector));
  return out;
}

/// Triangle lists, strips and fans (glTF 2.0 section 3.7.2.1) as triangles of vertex numbers.
std::vector<glm::uvec3> triangles(const std::vector<uint32_t>& v, int mode, const std::string& field) {
  if (v.empty() || (mode == TINYGLTF_MODE_TRIANGLES ? v.size() % 3 != 0 : v.size() < 3))
    ks::fail(KS_ERROR_FILE, "%s has %zu vertex indices, which is no whole number of triangles > 0", field.c_str(), v.size());
  std::vector<glm::uvec3> out;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    out.reserve(v.size() / 3);
    for (size_t i = 0; i + 2 < v.size(); i += 3) out.emplace_back(v[i], v[i + 1], v[i + 2]);
    return out;
  }
  for (size_t i = 0; i + 2 < v.size(); ++i) {
    const size_t odd = i % 2;
    if (mode == TINYGLTF_MODE_TRIANGLE_FAN)
      out.emplace_back(v[i + 1], v[i + 2], v[0]);
    else
      out.emplace_back(v[i], v[i + 1 + odd], v[i + 2 - odd]);
  }
  return out;
}

glm::vec3 area_normal(const Mesh& m, const glm::uvec3& t) {
  return glm::cross(m.positions[t[1]] - m.positions[t[0]], m.positions[t[2]] - m.positions[t[0]]);
}

/// Unit normals; where the file has a zero one, the mean of the triangles around it, weighted by area.
void normalise(Mesh& m) {
  std::vector<glm::vec3> around;
  for (size_t i = 0; i < m.normals.size(); ++i) {
    const float length = glm::length(m.normals[i]);
    if (length > 0.0f || std::isnan(length)) {
      m.normals[i] /= length;
      continue;
    }
    if (around.empty()) {
      around.assign(m.positions.size(), glm::vec3(0.0f));
      for (const glm::uvec3& t : m.indices)
        for (int k = 0; k < 3; ++k) around[t[k]] += area_normal(m, t);
    }
    const float mean = glm::length(around[i]);
    m.normals[i] = mean > 0.0f ? around[i] / mean : glm::vec3(0.0f, 0.0f, 1.0f);
  }
}

/// One vertex per triangle corner and the triangle's own normal on it: how a primitive without normals looks beside one with them.
void flatten(Mesh& m) {
  Mesh flat;
  flat.name = m.name;
  for (const glm::uvec3& t : m.indices) {
    const glm::vec3 normal = area_normal(m, t);
    const float length = glm::length(normal);
    const auto first = static_cast<uint32_t>(flat.positions.size());
    for (int k = 0; k < 3; ++k) {
      flat.positions.push_back(m.positions[t[k]]);
      if (!m.uvs.empty()) flat.uvs.push_back(m.uvs[t[k]]);
      if (!m.uvs_1.empty()) flat.uvs_1.push_back(m.uvs_1[t[k]]);
      if (!m.colors.empty()) flat.colors.push_back(m.colors[t[k]]);
      flat.normals.push_back(length > 0.0f ? normal / length : glm::vec3(0.0f, 0.0f, 1.0f));
    }
    flat.indices.emplace_back(first, first + 1, first + 2);
  }
  m = std::move(flat);
}

void check_index_range(const Mesh& part, const std::string& field) {
  for (size_t i = 0; i < part.indices.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (part.indices[i][k] >= part.positions.size())
        ks::fail(KS_ERROR_FILE, "%s: triangle %zu uses vertex %u, but POSITION has %zu", field.c_str(), i, part.indices[i][k],
                 part.positions.size());
}

/// Where a primitive's vertices come from: accessors, or compressed data in their place.
class Attributes {
 public:
  Attributes(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, const std::string& field)
      : import_(import),
        model_(model),
        primitive_(primitive),
        field_(field),
        draco_(DracoPrimitive::decode(import.budget, model, primitive, field)) {}

  [[nodiscard]] bool has(const char* name) const { return accessor(name) >= 0 || (draco_ && draco_->has(name)); }
  [[nodiscard]] std::vector<float> floats(const char* name, int components) const {
    const std::string user = field_ + ".attributes." + name;
    return draco_ && draco_->has(name) ? draco_->floats(name, components, user)
                                       : read_floats(import_.budget, model_, accessor(name), components, user);
  }
  template <class Vector>
  [[nodiscard]] std::vector<Vector> vectors(const char* name) const {
    return has(name) ? as_vectors<Vector>(floats(name, Vector::length())) : std::vector<Vector>();
  }
  /// COLOR_0 as linear RGBA; empty where it is 1 everywhere, which changes nothing.
  [[nodiscard]] std::vector<glm::vec4> colors() const {
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
  /// Compressed data holds triangles, whatever they were before.
  [[nodiscard]] int mode() const { return draco_ ? TINYGLTF_MODE_TRIANGLES : primitive_.mode; }
  /// Vertices of the triangles, in the order of the primitive's mode.
  [[nodiscard]] std::vector<uint32_t> indices(size_t vertex_count) const {
    if (draco_) return draco_->indices();
    if (primitive_.indices >= 0) return read_indices(import_.budget, model_, primitive_.indices, field_ + ".indices");
    import_.budget.claim(vertex_count * sizeof(uint32_t), field_);
    std::vector<uint32_t> out(vertex_count);
    std::iota(out.begin(), out.end(), 0u);
    return out;
  }

 private:
  [[nodiscard]] int accessor(const char* name) const {
    const auto found = primitive_.attributes.find(name);
    return found == primitive_.attributes.end() ? -1 : found->second;
  }
  [[nodiscard]] bool is_rgb(const char* name) const {
    if (draco_ && draco_->has(name)) return draco_->components(name) == 3;
    const auto index = static_cast<size_t>(accessor(name));
    return index < model_.accessors.size() && model_.accessors[index].type == TINYGLTF_TYPE_VEC3;
  }

  Import& import_;
  const tinygltf::Model& model_;
  const tinygltf::Primitive& primitive_;
  const std::string& field_;
  std::optional<DracoPrimitive> draco_;
};

Mesh read_primitive(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, bool uv_1,
                    const std::string& field) {
  const Attributes attributes(import, model, primitive, field);
  if (!attributes.has("POSITION")) ks::fail(KS_ERROR_FILE, "%s.attributes.POSITION is missing", field.c_str());
  Mesh part;
  part.positions = attributes.vectors<glm::vec3>("POSITION");
  part.normals = attributes.vectors<glm::vec3>("NORMAL");
  part.uvs = attributes.vectors<glm::vec2>("TEXCOORD_0");
  if (uv_1) part.uvs_1 = attributes.vectors<glm::vec2>("TEXCOORD_1");
  part.colors = attributes.colors();
  const size_t count = part.positions.size();
  const auto fits = [&](const auto& values) { return values.empty() || values.size() == count; };
  if (!fits(part.normals) || !fits(part.uvs) || !fits(part.uvs_1) || !fits(part.colors))
    ks::fail(KS_ERROR_FILE, "%s.attributes: %zu positions, %zu normals, %zu uvs, %zu of TEXCOORD_1, %zu of COLOR_0", field.c_str(), count,
             part.normals.size(), part.uvs.size(), part.uvs_1.size(), part.colors.size());
  const std::vector<uint32_t> vertices = attributes.indices(count);
  part.indices = triangles(vertices, attributes.mode(), field);
  check_index_range(part, field);
  normalise(part);
  if (!primitive.targets.empty()) import.warn(field + ": morph targets are ignored");
  return part;
}

/// An attribute of both; where only one has it, the other gets `missing`.
template <class T>
void join(std::vector<T>& all, size_t all_count, std::vector<T>& part, size_t part_count, const T& missing) {
  if (all.empty() && part.empty()) return;
  all.resize(all_count, missing);
  part.resize(part_count, missing);
  all.insert(all.end(), part.begin(), part.end());
}

void append(Mesh& mesh, Mesh&& part, uint32_t slot) {
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  join(mesh.uvs, base, part.uvs, part.positions.size(), glm::vec2(0.0f));
  join(mesh.uvs_1, base, part.uvs_1, part.positions.size(), glm::vec2(0.0f));
  join(mesh.colors, base, part.colors, part.positions.size(), glm::vec4(1.0f));
  mesh.positions.insert(mesh.positions.end(), part.positions.begin(), part.positions.end());
  mesh.normals.insert(mesh.normals.end(), part.normals.begin(), part.normals.end());
  for (const glm::uvec3& t : part.indices) mesh.indices.push_back(t + base);
  mesh.slots.insert(mesh.slots.end(), part.indices.size(), slot);
}

bool has_normals(const Mesh& mesh) { return !mesh.normals.empty(); }

}  // namespace

std::optional<GltfMesh> read_mesh(Import& import, const tinygltf::Model& model, size_t index, bool uv_1) {
  const tinygltf::Mesh& from = model.meshes[index];
  const std::string name = from.name.empty() ? "mesh" + std::to_string(index) : from.name;
  if (from.primitives.empty()) ks::fail(KS_ERROR_FILE, "meshes[%zu] '%s' has no primitives", index, name.c_str());
  GltfMesh out;
  std::vector<Mesh> parts;
  for (size_t i = 0; i < from.primitives.size(); ++i) {
    const std::string field = "meshes[" + std::to_string(index) + "] '" + name + "' primitives[" + std::to_string(i) + "]";
    const tinygltf::Primitive& primitive = from.primitives[i];
    if (primitive.mode < TINYGLTF_MODE_TRIANGLES) {
      import.warn(field + ": points and lines are ignored");
      continue;
    }
    if (primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN)
      ks::fail(KS_ERROR_FILE, "%s.mode is %d, must be 0 to 6", field.c_str(), primitive.mode);
    parts.push_back(read_primitive(import, model, primitive, uv_1, field));
    out.materials.push_back(primitive.material);
  }
  if (parts.empty()) return std::nullopt;
  const bool smooth = std::any_of(parts.begin(), parts.end(), has_normals);
  for (size_t slot = 0; slot < parts.size(); ++slot) {
    if (smooth && !has_normals(parts[slot])) flatten(parts[slot]);
    append(out.mesh, std::move(parts[slot]), static_cast<uint32_t>(slot));
  }
  out.mesh.name = name;
  return out;
}

}  // namespace kuafu
