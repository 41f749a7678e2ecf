// SPDX-License-Identifier: Apache-2.0
// A glTF mesh, all its primitives, as one kuafu mesh: primitive i that has triangles becomes a material slot.
#pragma once

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

}  // namespace kuafu
