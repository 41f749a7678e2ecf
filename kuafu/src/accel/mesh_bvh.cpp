#include "accel/mesh_bvh.h"

namespace kuafu {

MeshBvh build_mesh_bvh(const Mesh& mesh) {
  std::vector<Box> boxes(mesh.indices.size());
  for (size_t i = 0; i < boxes.size(); ++i)
    for (int corner = 0; corner < 3; ++corner) boxes[i].add(mesh.positions[mesh.indices[i][corner]]);
  Bvh bvh = build_bvh(boxes, bvh_max_leaf, bvh_bottom_depth);

  MeshBvh out{std::move(bvh.nodes), {}, bvh.bounds};
  out.triangles.reserve(bvh.order.size());
  for (const uint32_t id : bvh.order) {
    const glm::uvec3 corners = mesh.indices[id];
    out.triangles.push_back({mesh.positions[corners.x], id, mesh.positions[corners.y], 0, mesh.positions[corners.z], 0});
  }
  return out;
}

}  // namespace kuafu
