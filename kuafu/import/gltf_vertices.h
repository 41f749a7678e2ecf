// SPDX-License-Identifier: Apache-2.0
// Further data of a primitive's vertices: tangents (glTF 2.0 section 3.7.2.1), morph targets (section 3.7.2.2), joints and weights (section
// 3.7.3.3).
#pragma once

#include "import/gltf_attributes.h"
#include "scene/rig.h"

namespace kuafu {

/// Reads the tangents of `vertex_count` vertices. Empty if the material does not depend on them, or without normals, as the file's tangents
/// must then be ignored.
std::vector<glm::vec4> read_tangents(const GltfAttributes& attributes, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                     size_t vertex_count, const std::string& field);
/// Reads all sets of JOINTS_n and WEIGHTS_n; each vertex' weights sum to 1.
std::vector<SkinWeights> read_skin_weights(const GltfAttributes& attributes, size_t vertex_count, const std::string& field);
/// Reads POSITION, NORMAL and, if `tangents`, TANGENT of each morph target; warns of other attributes.
std::vector<MorphTarget> read_targets(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                      size_t vertex_count, bool tangents, const std::string& field);

}  // namespace kuafu
