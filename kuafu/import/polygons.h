// SPDX-License-Identifier: Apache-2.0
// Polygons, as OBJ, PLY and STL files have them, into meshes of triangles.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "import/import.h"

namespace kuafu {

/// A polygon's corner: numbers of the file's positions, texture coordinates, normals and colours. Only the first is always there.
struct Corner {
  uint32_t position = none, uv = none, normal = none, color = none;
  bool operator==(const Corner&) const = default;
};

/// Polygons that one instance shows in one material.
struct PolygonPart {
  std::string name;
  uint32_t material = none;  // the scene's number; none = grey, or white where there are colours
  std::vector<Corner> corners;
  std::vector<uint32_t> sizes;  // corners of each polygon, 3 or more

  /// Takes the last `count` of the corners as a polygon; fewer than three are no surface and dropped.
  void close(size_t count);
};

struct Polygons {
  std::vector<glm::vec3> positions, normals;  // normals of any length
  std::vector<glm::vec2> uvs;                 // v up
  std::vector<glm::vec4> colors;              // linear RGBA
  std::vector<PolygonPart> parts;
};

/// A mesh and an instance for each part that has polygons. Corners must name what is there. Throws KS_ERROR_FILE where no part has any.
void add_polygons(Import& import, const Polygons& polygons);

/// Appends a polygon's n - 2 triangles as numbers of its corners, in its own direction. Ears are cut off one after another (Meisters,
/// Polygons have ears, 1975), so that a concave polygon stays as it is; a convex one becomes a fan.
void triangulate(std::span<const glm::vec3> corners, std::vector<glm::uvec3>& triangles);

/// Each reads a whole file's text or bytes. Throws KS_ERROR_FILE with the place of what is wrong.
Polygons read_obj(Import& import, std::string_view file);
Polygons read_ply(Import& import, std::string_view file);
Polygons read_stl(Import& import, std::string_view file);

}  // namespace kuafu
