// SPDX-License-Identifier: Apache-2.0
// The geometry of an OBJ, PLY or STL file as a plain reader counts it. What assimp makes of the file is compared with it: a vertex that a
// reader drops moves every later index, and nothing else would tell.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

struct aiScene;

namespace kuafu {

struct PlainMesh {
  uint64_t faces = 0, corners = 0;  // of polygons with three corners or more
  glm::dvec3 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};  // of the vertices they use

  void use(const glm::dvec3& position) { low = glm::min(low, position), high = glm::max(high, position); }
};

/// An OBJ file in the words that assimp reads right: one statement a line, numbers that begin with a digit or '-', corners by positive
/// indices. Throws KS_ERROR_FILE that names the line.
struct PlainObj {
  PlainMesh mesh;
  std::vector<uint8_t> text;
};
PlainObj plain_obj(std::string_view file);

/// None where the file has strips, which only assimp counts. The header must have passed check_ply.
std::optional<PlainMesh> plain_ply(std::string_view file);

/// Both kinds of STL: ASCII and binary.
PlainMesh plain_stl(std::string_view file);

/// Throws KS_ERROR_FILE with both figures where what assimp read differs.
void check_against(const PlainMesh& plain, const aiScene& read);

}  // namespace kuafu
