// SPDX-License-Identifier: Apache-2.0
// TANGENT of a primitive (glTF 2.0 section 3.7.2.1), where something in its material follows it.
#pragma once

#include <string>
#include <vector>

#include "import/gltf_attributes.h"

namespace kuafu {

/// Mesh::tangents of `vertex_count` vertices; empty where the material turns with nothing, and without normals, where the file's are to be
/// ignored.
std::vector<glm::vec4> read_tangents(const GltfAttributes& attributes, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                     size_t vertex_count, const std::string& field);

}  // namespace kuafu
