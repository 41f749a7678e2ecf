// The top level: one BVH2 over world boxes of instances per environment, all in one node array.
// Thread rule: pure function; uses the given workers.
#pragma once

#include "accel/bvh_builder.h"
#include "accel/placement.h"
#include "device/thread_pool.h"

namespace kuafu {

struct InstanceBvhs {
  std::vector<BvhNode> nodes;
  std::vector<uint32_t> roots;  // child code per environment; bvh_done where it is empty
};

/// mesh_bounds: local box per mesh id. Leaves name placements by their index.
InstanceBvhs build_instance_bvhs(const std::vector<Placement>& placements, std::span<const Box> mesh_bounds, uint32_t environment_count,
                                 ks::ThreadPool& workers);

}  // namespace kuafu
