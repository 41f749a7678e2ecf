// SPDX-License-Identifier: Apache-2.0
#include "import/polygons.h"

#include <unordered_map>

#include "device/error.h"
#include "import/phong_material.h"
#include "io/load.h"

namespace kuafu {
namespace {

struct CornerHash {
  size_t operator()(const Corner& c) const {
    uint64_t hash = c.position;
    for (const uint32_t number : {c.uv, c.normal, c.color}) hash = (hash ^ (hash >> 32)) * 0x9e3779b97f4a7c15u + number;
    return hash ^ (hash >> 29);
  }
};

/// Vertices of a part: each corner that differs from all others, once.
class Vertices {
 public:
  Vertices(const Polygons& from, Mesh& to) : from_(from), to_(to) {}

  uint32_t number(const Corner& corner) {
    const auto [entry, is_new] = numbers_.try_emplace(corner, static_cast<uint32_t>(to_.positions.size()));
    if (is_new) add(corner);
    return entry->second;
  }

  /// Takes away what no vertex, or not every vertex, has.
  void finish() {
    if (!has_uvs_) to_.uvs.clear();
    if (!has_colors_) to_.colors.clear();
    if (!has_normals_) to_.normals.clear();
  }

 private:
  void add(const Corner& corner) {
    to_.positions.push_back(from_.positions[corner.position]);
    has_uvs_ |= corner.uv != none;
    const glm::vec2 uv = corner.uv == none ? glm::vec2(0.0f) : from_.uvs[corner.uv];
    to_.uvs.emplace_back(uv.x, 1.0f - uv.y);
    has_colors_ |= corner.color != none;
    to_.colors.push_back(corner.color == none ? glm::vec4(1.0f) : from_.colors[corner.color]);
    const glm::dvec3 normal = corner.normal == none ? glm::dvec3(0.0) : glm::dvec3(from_.normals[corner.normal]);
    const double length = glm::length(normal);
    has_normals_ &= length > 0.0;  // a file with a zero normal gets geometric normals
    to_.normals.emplace_back(length > 0.0 ? normal / length : normal);
  }

  const Polygons& from_;
  Mesh& to_;
  std::unordered_map<Corner, uint32_t, CornerHash> numbers_;
  bool has_uvs_ = false, has_colors_ = false, has_normals_ = true;
};

Mesh mesh_of(const Polygons& polygons, const PolygonPart& part) {
  Mesh mesh;
  Vertices vertices(polygons, mesh);
  std::vector<glm::vec3> places;
  std::vector<glm::uvec3> triangles;
  std::span<const Corner> rest = part.corners;
  for (const uint32_t size : part.sizes) {
    const auto corners = rest.first(size);
    rest = rest.subspan(size);
    places.clear();
    for (const Corner& corner : corners) places.push_back(polygons.positions[corner.position]);
    triangles.clear();
    triangulate(places, triangles);
    for (const glm::uvec3& t : triangles) {
      const uint32_t a = vertices.number(corners[t.x]), b = vertices.number(corners[t.y]), c = vertices.number(corners[t.z]);
      mesh.indices.emplace_back(a, b, c);
    }
  }
  vertices.finish();
  return mesh;
}

/// A polygon on the plane that it lies in most, counter-clockwise; an ear is the triangle at a convex corner that no other corner lies in.
class EarCutter {
 public:
  explicit EarCutter(std::span<const glm::vec3> corners) : count_(static_cast<uint32_t>(corners.size())) {
    glm::dvec3 normal(0.0);  // twice the area (Newell)
    const glm::dvec3 origin(corners[0]);
    for (uint32_t i = 1; i + 1 < count_; ++i) normal += glm::cross(glm::dvec3(corners[i]) - origin, glm::dvec3(corners[i + 1]) - origin);
    const glm::dvec3 size = glm::abs(normal);
    const int away = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    int u = (away + 1) % 3, v = (away + 2) % 3;
    if (normal[away] < 0.0) std::swap(u, v);
    for (uint32_t i = 0; i < count_; ++i) {
      places_.emplace_back(corners[i][u], corners[i][v]);
      before_.push_back((i + count_ - 1) % count_);
      after_.push_back((i + 1) % count_);
    }
    for (uint32_t i = 0; i < count_; ++i)
      if (area(before_[i], i, after_[i]) <= 0.0) hollow_.push_back(i);
  }

  void cut(std::vector<glm::uvec3>& triangles) {
    uint32_t at = 1, passed = 0;
    for (uint32_t left = count_; left > 2;) {
      // Without any ear the polygon crosses itself, and any corner will do.
      if (left > 3 && passed < left && !is_ear(at)) {
        at = after_[at];
        ++passed;
        continue;
      }
      triangles.emplace_back(before_[at], at, after_[at]);
      after_[before_[at]] = after_[at];
      before_[after_[at]] = before_[at];
      std::erase(hollow_, at);
      at = after_[at];
      passed = 0;
      --left;
    }
  }

 private:
  [[nodiscard]] double area(uint32_t a, uint32_t b, uint32_t c) const { return area(a, b, places_[c]); }
  [[nodiscard]] double area(uint32_t a, uint32_t b, const glm::dvec2& c) const {
    const glm::dvec2 ab = places_[b] - places_[a], ac = c - places_[a];
    return ab.x * ac.y - ab.y * ac.x;
  }

  [[nodiscard]] bool is_ear(uint32_t at) const {
    const uint32_t a = before_[at], b = at, c = after_[at];
    if (area(a, b, c) <= 0.0) return false;
    for (const uint32_t other : hollow_) {
      const glm::dvec2& p = places_[other];
      if (p == places_[a] || p == places_[b] || p == places_[c]) continue;  // a bridge to a hole passes a corner twice
      if (area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0) return false;
    }
    return true;
  }

  uint32_t count_;
  std::vector<glm::dvec2> places_;
  std::vector<uint32_t> before_, after_;
  std::vector<uint32_t> hollow_;  // corners that were not convex at first: only those can lie in an ear
};

}  // namespace

void PolygonPart::close(size_t count) {
  if (count >= 3)
    sizes.push_back(static_cast<uint32_t>(count));
  else
    corners.resize(corners.size() - count);
}

void triangulate(std::span<const glm::vec3> corners, std::vector<glm::uvec3>& triangles) {
  if (corners.size() == 3)
    triangles.emplace_back(0, 1, 2);
  else
    EarCutter(corners).cut(triangles);
}

void add_polygons(Import& import, const Polygons& polygons) {
  uint32_t colored = none;  // shows colours where there is no material
  for (const PolygonPart& part : polygons.parts) {
    if (part.sizes.empty()) continue;
    Mesh mesh = mesh_of(polygons, part);
    Instance instance;
    instance.name = mesh.name = part.name.empty() ? "mesh" + std::to_string(import.scene.meshes().size()) : clean_name(part.name);
    uint32_t material = part.material;
    if (material == none && !mesh.colors.empty()) {
      if (colored == none) colored = import.scene.add_material(colored_material());
      material = colored;
    }
    instance.mesh = import.scene.add_mesh(std::move(mesh));
    instance.materials = {material};
    instance.local_to_world = import.root_to_world;
    import.scene.add_instance(std::move(instance));
  }
  if (!import.scene.instances().empty()) return;
  if (polygons.positions.empty()) ks::fail(KS_ERROR_FILE, "there is no surface in it: it has neither points nor faces");
  ks::fail(
      KS_ERROR_FILE,
      "this is a point cloud: it has %zu points and no faces, and only surfaces are rendered: make a mesh of it, as by MeshLab's surface "
      "reconstruction",
      polygons.positions.size());
}

void import_mesh(Import& import) {
  const std::vector<uint8_t> bytes = import.folder.read_scene_file();
  const std::string_view file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const std::string extension = lower_extension(import.path);
  add_polygons(import, extension == ".obj"   ? read_obj(import, file)
                       : extension == ".ply" ? read_ply(import, file)
                                             : read_stl(import, file));
}

}  // namespace kuafu
