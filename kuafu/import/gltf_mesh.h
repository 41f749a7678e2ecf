// SPDX-License-Identifier: Apache-2.0
// A glTF mesh, all its primitives, as one kuafu mesh: primitive i that has triangles becomes a material slot.
#pragma once

#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "import/gltf_document.h"
#include "import/import.h"
#include "scene/rig.h"

namespace kuafu {

struct GltfMesh {
  Mesh mesh;
  std::vector<int> materials;  // per slot: index into the file's materials, -1 = glTF's default material
  // Skin and targets that move its vertices (scene/rig.h).
  std::vector<SkinWeights> skin_weights;
  std::vector<MorphTarget> targets;
};

/// Reads a mesh; triangle strips and fans become triangles. uv_1: whether TEXCOORD_1 is read. Nothing, with a warning, if the mesh has only
/// points and lines.
std::optional<GltfMesh> read_mesh(Import& import, const tinygltf::Model& model, size_t index, bool uv_1);

/// Returns the transform of each copy of a node's mesh to the node (EXT_mesh_gpu_instancing); one identity if the node lacks the extension.
std::vector<glm::dmat4> gpu_instances(Import& import, const tinygltf::Model& model, const tinygltf::Node& node, const std::string& field);

}  // namespace kuafu
