// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_mesh.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "device/error.h"
#include "import/gltf_attributes.h"

namespace kuafu {
namespace {

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

/// Calls `each` with every array that has a value for each vertex, but for normals and tangents, which a primitive without normals has not.
template <class Each>
void for_each_array(GltfMesh& m, Each&& each) {
  each(m.mesh.positions), each(m.mesh.uvs), each(m.mesh.uvs_1), each(m.mesh.colors);
  for (SkinWeights& set : m.skin_weights) each(set.joints), each(set.weights);
  for (MorphTarget& target : m.targets) each(target.positions), each(target.normals);
}

/// One vertex per triangle corner and the triangle's own normal on it: how a primitive without normals looks beside one with them.
void flatten(GltfMesh& m) {
  std::vector<uint32_t> corners;
  std::vector<glm::vec3> normals;
  for (const glm::uvec3& t : m.mesh.indices) {
    const glm::vec3 normal = area_normal(m.mesh, t);
    const float length = glm::length(normal);
    normals.insert(normals.end(), 3, length > 0.0f ? normal / length : glm::vec3(0.0f, 0.0f, 1.0f));
    corners.insert(corners.end(), {t[0], t[1], t[2]});
  }
  for_each_array(m, [&](auto& values) {
    if (values.empty()) return;
    std::remove_reference_t<decltype(values)> flat;
    flat.reserve(corners.size());
    for (const uint32_t corner : corners) flat.push_back(values[corner]);
    values = std::move(flat);
  });
  m.mesh.normals = std::move(normals);
  for (uint32_t i = 0; i < m.mesh.indices.size(); ++i) m.mesh.indices[i] = {3 * i, 3 * i + 1, 3 * i + 2};
}

void check_index_range(const Mesh& part, const std::string& field) {
  for (size_t i = 0; i < part.indices.size(); ++i)
    for (int k = 0; k < 3; ++k)
      if (part.indices[i][k] >= part.positions.size())
        ks::fail(KS_ERROR_FILE, "%s: triangle %zu uses vertex %u, but POSITION has %zu", field.c_str(), i, part.indices[i][k],
                 part.positions.size());
}

GltfMesh read_primitive(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, bool uv_1,
                        const std::string& field) {
  const GltfAttributes attributes(import, model, primitive, field);
  if (!attributes.has("POSITION")) ks::fail(KS_ERROR_FILE, "%s.attributes.POSITION is missing", field.c_str());
  GltfMesh out;
  Mesh& part = out.mesh;
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
  out.skin_weights = read_skin_weights(attributes, count, field);
  part.tangents = read_tangents(attributes, model, primitive, count, field);
  out.targets = read_targets(import, model, primitive, count, !part.tangents.empty(), field);
  const std::vector<uint32_t> vertices = attributes.indices(count);
  part.indices = triangles(vertices, attributes.mode(), field);
  check_index_range(part, field);
  normalise(part);
  return out;
}

/// An attribute of both; where only one has it, the other gets `missing`.
template <class T>
void join(std::vector<T>& all, size_t all_count, std::vector<T>& part, size_t part_count, const T& missing) {
  if (all.empty() && part.empty()) return;
  all.resize(all_count, missing);
  part.resize(part_count, missing);
  all.insert(all.end(), part.begin(), part.end());
}

void append(GltfMesh& all, GltfMesh&& part, uint32_t slot) {
  Mesh &mesh = all.mesh, &more = part.mesh;
  const auto base = static_cast<uint32_t>(mesh.positions.size());
  const size_t count = more.positions.size();
  join(mesh.uvs, base, more.uvs, count, glm::vec2(0.0f));
  join(mesh.uvs_1, base, more.uvs_1, count, glm::vec2(0.0f));
  join(mesh.colors, base, more.colors, count, glm::vec4(1.0f));
  join(mesh.tangents, base, more.tangents, count, glm::vec4(0.0f));
  const size_t sets = std::max(all.skin_weights.size(), part.skin_weights.size()),
               targets = std::max(all.targets.size(), part.targets.size());
  all.skin_weights.resize(sets), part.skin_weights.resize(sets), all.targets.resize(targets), part.targets.resize(targets);
  for (size_t i = 0; i < sets; ++i) {
    join(all.skin_weights[i].joints, base, part.skin_weights[i].joints, count, glm::uvec4(0u));
    join(all.skin_weights[i].weights, base, part.skin_weights[i].weights, count, i == 0 ? glm::vec4(1, 0, 0, 0) : glm::vec4(0.0f));
  }
  for (size_t i = 0; i < targets; ++i) {
    join(all.targets[i].positions, base, part.targets[i].positions, count, glm::vec3(0.0f));
    join(all.targets[i].normals, base, part.targets[i].normals, count, glm::vec3(0.0f));
    join(all.targets[i].tangents, base, part.targets[i].tangents, count, glm::vec3(0.0f));
  }
  mesh.positions.insert(mesh.positions.end(), more.positions.begin(), more.positions.end());
  mesh.normals.insert(mesh.normals.end(), more.normals.begin(), more.normals.end());
  for (const glm::uvec3& t : more.indices) mesh.indices.push_back(t + base);
  mesh.slots.insert(mesh.slots.end(), more.indices.size(), slot);
}

bool has_normals(const GltfMesh& part) { return !part.mesh.normals.empty(); }

}  // namespace

std::optional<GltfMesh> read_mesh(Import& import, const tinygltf::Model& model, size_t index, bool uv_1) {
  const tinygltf::Mesh& from = model.meshes[index];
  const std::string name = from.name.empty() ? "mesh" + std::to_string(index) : from.name;
  if (from.primitives.empty()) ks::fail(KS_ERROR_FILE, "meshes[%zu] '%s' has no primitives", index, name.c_str());
  GltfMesh out;
  std::vector<GltfMesh> parts;
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
    append(out, std::move(parts[slot]), static_cast<uint32_t>(slot));
  }
  out.mesh.name = name;
  return out;
}

}  // namespace kuafu
