// SPDX-License-Identifier: Apache-2.0
// TANGENT of a primitive (glTF 2.0 section 3.7.2.1), where something in its material follows it.
#pragma once

#include <string>
#include <vector>

#include "import/gltf_attributes.h"

namespace kuafu {

/// Reads the tangents of `vertex_count` vertices. Empty if the material does not depend on them, or without normals, as the file's tangents
/// must then be ignored.
std::vector<glm::vec4> read_tangents(const GltfAttributes& attributes, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                     size_t vertex_count, const std::string& field);

}  // namespace kuafu
