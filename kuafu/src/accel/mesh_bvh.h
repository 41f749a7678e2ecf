// SPDX-License-Identifier: Apache-2.0
// The bottom level: one mesh's BVH2 with its triangles in leaf order, built or refitted.
// Thread rule: pure function.
#pragma once

#include "accel/bvh_builder.h"
#include "scene/scene.h"

namespace kuafu {

struct MeshBvh {
  std::vector<BvhNode> nodes;
  std::vector<BvhTriangle> triangles;
  Box bounds;  // local space; empty for a mesh without triangles
};

MeshBvh build_mesh_bvh(const Mesh& mesh);
/// Moves triangles and boxes to the mesh's present vertices; the tree keeps its shape.
void refit_mesh_bvh(MeshBvh& bvh, const Mesh& mesh);

}  // namespace kuafu
