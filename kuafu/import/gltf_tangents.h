// SPDX-License-Identifier: Apache-2.0
// What is lost where a file's TANGENT is not read: normal maps and anisotropy follow the texture coordinates of each triangle in its place.
#pragma once

#include <string>
#include <vector>

#include "import/gltf_document.h"
#include "import/import.h"
#include "scene/scene.h"

namespace kuafu {

/// Degrees between the file's tangents and those of the texture coordinates, as a mean over the area; -1 where no triangle has both.
/// `tangents`: one for each vertex of `mesh`, which has uvs and normals; w is the side of the bitangent.
double degrees_off(const Mesh& mesh, const std::vector<glm::vec4>& tangents);

/// Warns where the material of `primitive` turns with its tangents and they are more than 5 degrees off.
void judge_tangents(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, const Mesh& mesh,
                    const std::vector<glm::vec4>& tangents, const std::string& field);

}  // namespace kuafu
