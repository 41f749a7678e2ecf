#include "accel/instance_bvh.h"

#include <cmath>

#include "device/error.h"

namespace kuafu {
namespace {

/// World box of a local box, rounded outwards.
Box world_box(const Box& local, const glm::dmat4& local_to_world) {
  glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 p(corner & 1 ? local.max.x : local.min.x, corner & 2 ? local.max.y : local.min.y,
                       corner & 4 ? local.max.z : local.min.z, 1.0);
    const glm::dvec3 q(local_to_world * p);
    low = glm::min(low, q), high = glm::max(high, q);
  }
  Box box;
  const float infinity = std::numeric_limits<float>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    box.min[axis] = std::nextafter(float(low[axis]), -infinity);
    box.max[axis] = std::nextafter(float(high[axis]), infinity);
  }
  return box;
}

/// Turns the builder's codes into codes of the shared array: nodes move by `base`, leaf entries become instances.
uint32_t placed_code(uint32_t code, uint32_t base, const Bvh& bvh, const std::vector<uint32_t>& instances) {
  if (!(code & bvh_leaf)) return code + base;
  const bool holds_one = (code >> bvh_count_shift & 7u) != 0;
  return holds_one ? (code & ~bvh_first_mask) | instances[bvh.order[code & bvh_first_mask]] : code;
}

}  // namespace

InstanceBvhs build_instance_bvhs(const std::vector<Placement>& placements, std::span<const Box> mesh_bounds, uint32_t environment_count,
                                 ks::ThreadPool& workers) {
  std::vector<Box> boxes(placements.size());
  for (size_t i = 0; i < boxes.size(); ++i)
    if (placements[i].traceable) boxes[i] = world_box(mesh_bounds[placements[i].mesh], placements[i].local_to_world);

  const auto seen = placements_by_environment(placements, environment_count);
  std::vector<Bvh> bvhs(environment_count);
  workers.parallel_for(environment_count, [&](size_t environment) {
    std::vector<Box> own;
    for (const uint32_t i : seen[environment]) own.push_back(boxes[i]);
    if (!own.empty()) bvhs[environment] = build_bvh(own, 1, bvh_top_depth);
  });

  InstanceBvhs out;
  for (uint32_t environment = 0; environment < environment_count; ++environment) {
    const Bvh& bvh = bvhs[environment];
    const auto base = uint32_t(out.nodes.size());
    out.roots.push_back(bvh.nodes.empty() ? bvh_done : base);
    for (BvhNode node : bvh.nodes) {
      node.child0 = placed_code(node.child0, base, bvh, seen[environment]);
      node.child1 = placed_code(node.child1, base, bvh, seen[environment]);
      out.nodes.push_back(node);
    }
  }
  if (out.nodes.size() >= bvh_leaf)
    ks::fail(KS_ERROR_UNSUPPORTED, "%zu top-level nodes over all environments, more than 2^31", out.nodes.size());
  return out;
}

}  // namespace kuafu
