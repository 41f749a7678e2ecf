// SPDX-License-Identifier: Apache-2.0
// The bottom level and its refit.
#include "accel/mesh_bvh.h"

#include <gtest/gtest.h>

#include <cstring>

#include "kuafu/accel/worlds.h"

namespace kuafu::test {
namespace {

Mesh shaken(Mesh mesh, double reach) {
  Random random(5);
  for (glm::vec3& position : mesh.positions) position += glm::vec3(random.in_cube(reach));
  return mesh;
}

bool same(const Box& a, const Box& b) { return a.min == b.min && a.max == b.max; }

/// Box of what is below a child; every box on the way must be exactly that of what it holds.
Box walk(const MeshBvh& bvh, const Mesh& mesh, uint32_t code) {
  Box box;
  if (code & bvh_leaf) {
    for (uint32_t i = 0; i < (code >> bvh_count_shift & 7u); ++i) {
      const BvhTriangle& triangle = bvh.triangles.at((code & bvh_first_mask) + i);
      const glm::uvec3 corners = mesh.indices.at(triangle.primitive);
      EXPECT_EQ(triangle.v0, mesh.positions[corners.x]);
      EXPECT_EQ(triangle.v1, mesh.positions[corners.y]);
      EXPECT_EQ(triangle.v2, mesh.positions[corners.z]);
      box.add(triangle.v0), box.add(triangle.v1), box.add(triangle.v2);
    }
    return box;
  }
  const BvhNode& node = bvh.nodes.at(code);
  for (int child = 0; child < 2; ++child) {
    const Box below = walk(bvh, mesh, child == 0 ? node.child0 : node.child1);
    EXPECT_TRUE(same(child_box(node, child), below));
    box.add(below);
  }
  return box;
}

TEST(MeshBvh, RefittedBoxesAreExactlyThoseOfTheirTriangles) {
  Random random(1);
  for (const Mesh& mesh : {soup(random, 1, 0.3), soup(random, 5, 0.3), soup(random, 700, 0.3), sphere(12)}) {
    MeshBvh bvh = build_mesh_bvh(mesh);
    const Mesh moved = shaken(mesh, 0.5);
    refit_mesh_bvh(bvh, moved);
    EXPECT_TRUE(same(bvh.bounds, walk(bvh, moved, 0)));
  }
}

TEST(MeshBvh, RefitWithoutMotionChangesNoBit) {
  const Mesh mesh = sphere(20);
  const MeshBvh built = build_mesh_bvh(mesh);
  MeshBvh refitted = built;
  refit_mesh_bvh(refitted, mesh);
  EXPECT_EQ(std::memcmp(refitted.nodes.data(), built.nodes.data(), built.nodes.size() * sizeof(BvhNode)), 0);
}

TEST(MeshBvh, CostGrowsWhenNeighboursPartAndNotWhenTheyStayTogether) {
  const Mesh mesh = sphere(20);
  MeshBvh bvh = build_mesh_bvh(mesh);
  const double built = expected_cost(bvh.nodes);
  Mesh scaled = mesh;
  for (glm::vec3& position : scaled.positions) position = 2.0f * position + 1.0f;
  refit_mesh_bvh(bvh, scaled);
  EXPECT_NEAR(expected_cost(bvh.nodes), built, 1e-4 * built);
  refit_mesh_bvh(bvh, shaken(mesh, 0.02));
  EXPECT_LT(expected_cost(bvh.nodes), 1.5 * built);
  refit_mesh_bvh(bvh, shaken(mesh, 1.0));
  EXPECT_GT(expected_cost(bvh.nodes), 1.5 * built);
}

}  // namespace
}  // namespace kuafu::test
