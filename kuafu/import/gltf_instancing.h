// SPDX-License-Identifier: Apache-2.0
// EXT_mesh_gpu_instancing: many copies of a node's mesh, placed by arrays.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "import/gltf_document.h"
#include "import/import.h"

namespace kuafu {

/// Returns the transform of each copy to its node; one identity if the node lacks the extension.
std::vector<glm::dmat4> gpu_instances(Import& import, const tinygltf::Model& model, const tinygltf::Node& node, const std::string& field);

}  // namespace kuafu
