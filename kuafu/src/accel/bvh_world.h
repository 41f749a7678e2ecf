// SPDX-License-Identifier: Apache-2.0
// The scene as our own tracer knows it, in device memory: a BVH2 per mesh, built once or refitted, and a top level per environment, which
// follows single instances. Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <unordered_map>

#include "accel/array_buffer.h"
#include "accel/mesh_bvh.h"
#include "accel/placement.h"
#include "accel/top_level.h"
#include "scene/mesh_watch.h"
#include "shared/motion_record.h"

namespace kuafu {

class BvhWorld {
 public:
  explicit BvhWorld(std::shared_ptr<ks::Device> device) : device_(std::move(device)) {}

  void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open);
  /// Number of environments; 0 before the first scene.
  [[nodiscard]] uint32_t environment_count() const { return environment_count_; }
  // Device addresses of arrays (shared/bvh_node.h).
  [[nodiscard]] uint64_t roots() const { return roots_.address(); }  // child code of each environment's top level
  [[nodiscard]] uint64_t nodes() const { return nodes_.address(); }  // of all top levels
  [[nodiscard]] uint64_t instances() const { return instances_.address(); }
  [[nodiscard]] uint64_t motions() const { return motions_.address(); }  // as instances, where any moves
  [[nodiscard]] bool moves() const { return !times_.instant(); }

 private:
  /// A mesh whose vertices have moved before, and probably will again: the host keeps its tree, and it has device memory of its own.
  struct Deforming {
    MeshBvh bvh;
    double cost_when_built = 0.0;
    ArrayBuffer block;
  };
  struct PlacedMesh {
    uint64_t nodes = 0, triangles = 0;  // device addresses
    Box bounds;
    std::shared_ptr<ks::Buffer> block;  // with meshes of its time, as long as one of them is left
    std::unique_ptr<Deforming> deforming;
  };
  /// An environment's part of the node array.
  struct Part {
    TopLevel top;
    uint32_t first = 0, capacity = 0;
  };

  void forget();
  std::vector<uint32_t> follow_meshes(const Scene& scene);
  void add_meshes(const Scene& scene, const std::vector<uint32_t>& ids);
  void deform(const Mesh& mesh, PlacedMesh& placed) const;
  void upload(PlacedMesh& placed) const;
  void place_all(const Scene& scene, uint32_t environment_count);
  void follow(const Scene& scene, const std::vector<uint32_t>& slots);
  void put(uint32_t slot, const Placement& placement);
  void follow_in(uint32_t environment, uint32_t slot, bool before, bool after);
  void build(uint32_t environment);
  void upload_tops();
  void upload_all_tops();
  void upload_roots();

  std::shared_ptr<ks::Device> device_;
  std::shared_ptr<const void> scene_;  // its identity; null: none, or the last update failed
  MeshWatch watch_;
  std::unordered_map<uint32_t, PlacedMesh> meshes_;  // by id
  uint64_t instances_revision_ = 0;
  TimeSpan times_;
  uint32_t environment_count_ = 0;
  // By slot.
  std::vector<Placement> placements_;
  std::vector<Box> boxes_;  // world
  std::vector<BvhInstance> records_;
  std::vector<MotionRecord> motion_records_;  // where any moves
  std::vector<Part> parts_;                   // by environment
  std::vector<BvhNode> all_nodes_;            // what the device has
  std::vector<uint32_t> all_roots_;
  ArrayBuffer nodes_, instances_, roots_, motions_;
};

}  // namespace kuafu
