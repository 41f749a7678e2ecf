// SPDX-License-Identifier: Apache-2.0
// Polygons, as OBJ, PLY and STL files have them, into meshes of triangles.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "import/import.h"

namespace kuafu {

/// A polygon's corner: indices of the file's positions, texture coordinates, normals and colours. Only the position is always there.
struct Corner {
  uint32_t position = none, uv = none, normal = none, color = none;
  bool operator==(const Corner&) const = default;
};

/// Polygons that one instance shows with one material.
struct PolygonPart {
  std::string name;
  uint32_t material = none;  // the scene's number; none = grey, or white where there are colours
  std::vector<Corner> corners;
  std::vector<uint32_t> sizes;  // corners of each polygon, 3 or more

  /// Makes a polygon of the last `count` corners; drops fewer than three.
  void close(size_t count);
};

struct Polygons {
  std::vector<glm::vec3> positions, normals;  // normals of any length
  std::vector<glm::vec2> uvs;                 // v up
  std::vector<glm::vec4> colors;              // linear RGBA
  std::vector<PolygonPart> parts;
};

/// Adds a mesh and an instance for each part with polygons. Corners must have valid indices. Throws KS_ERROR_FILE if no part has any.
void add_polygons(Import& import, const Polygons& polygons);

/// Appends a polygon's n - 2 triangles, as indices of its corners, with its orientation. It cuts off one ear after another (Meisters,
/// Polygons have ears, 1975), so concave polygons keep their shape; convex ones become fans.
void triangulate(std::span<const glm::vec3> corners, std::vector<glm::uvec3>& triangles);

/// Read a whole file. Throw KS_ERROR_FILE with the place of an error.
Polygons read_obj(Import& import, std::string_view file);
Polygons read_ply(Import& import, std::string_view file);
Polygons read_stl(Import& import, std::string_view file);

}  // namespace kuafu
