// SPDX-License-Identifier: Apache-2.0
#include "accel/mesh_bvh.h"

#include <span>

#include "device/interrupt.h"

namespace kuafu {
namespace {

BvhTriangle triangle_of(const Mesh& mesh, uint32_t id) {
  const glm::uvec3 corners = mesh.indices[id];
  return {mesh.positions[corners.x], id, mesh.positions[corners.y], 0, mesh.positions[corners.z], 0};
}

Box leaf_box(const MeshBvh& bvh, uint32_t leaf) {
  Box box;
  const uint32_t first = leaf & bvh_first_mask, count = leaf >> bvh_count_shift & 7u;
  for (const BvhTriangle& t : std::span(bvh.triangles).subspan(first, count)) box.add(t.v0), box.add(t.v1), box.add(t.v2);
  return box;
}

}  // namespace

MeshBvh build_mesh_bvh(const Mesh& mesh) {
  std::vector<Box> boxes(mesh.indices.size());
  for (size_t i = 0; i < boxes.size(); ++i) {
    ks::interruption_point(i);
    for (int corner = 0; corner < 3; ++corner) boxes[i].add(mesh.positions[mesh.indices[i][corner]]);
  }
  Bvh bvh = build_bvh(boxes, bvh_max_leaf, bvh_bottom_depth);

  MeshBvh out{std::move(bvh.nodes), {}, bvh.bounds};
  out.triangles.reserve(bvh.order.size());
  for (size_t i = 0; i < bvh.order.size(); ++i) {
    ks::interruption_point(i);
    out.triangles.push_back(triangle_of(mesh, bvh.order[i]));
  }
  return out;
}

void refit_mesh_bvh(MeshBvh& bvh, const Mesh& mesh) {
  for (size_t i = 0; i < bvh.triangles.size(); ++i) {
    ks::interruption_point(i);
    bvh.triangles[i] = triangle_of(mesh, bvh.triangles[i].primitive);
  }
  for (size_t i = bvh.nodes.size(); i-- > 0;) {  // parents come before children
    ks::interruption_point(i);
    BvhNode& node = bvh.nodes[i];
    for (int child = 0; child < 2; ++child) {
      const uint32_t code = child == 0 ? node.child0 : node.child1;
      set_child_box(node, child, code & bvh_leaf ? leaf_box(bvh, code) : node_box(bvh.nodes[code]));
    }
  }
  bvh.bounds = node_box(bvh.nodes.front());
}

}  // namespace kuafu
