// SPDX-License-Identifier: Apache-2.0
// The scene as the driver's ray tracing knows it: a bottom level per mesh, built once or refitted, and a top level per environment.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <unordered_map>

#include "accel/placement.h"
#include "accel/rt_structure.h"
#include "scene/mesh_watch.h"

namespace kuafu {

class RtWorld {
 public:
  explicit RtWorld(std::shared_ptr<ks::Device> device);

  void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open);
  /// Records the builds of top levels that the last update changed; call before the first ray. Returns whether there were any.
  bool record(ks::Commands& commands) { return builder_.record(commands); }
  /// Number of environments; 0 before the first scene.
  [[nodiscard]] uint32_t environment_count() const { return environment_count_; }
  /// Address of an array with each environment's top level; 0 for an empty one.
  [[nodiscard]] uint64_t top_levels() const { return addresses_.address(); }

 private:
  struct Bottom {
    RtStructure structure;
    bool updatable = false;
    uint32_t refits = 0;
  };
  struct Geometry;  // meshes' vertices and triangles, as long as a build needs them

  void forget();
  std::vector<uint32_t> follow_meshes(const Scene& scene);
  void build_meshes(const Scene& scene, const std::vector<uint32_t>& ids, bool updatable);
  void refit_meshes(const Scene& scene, const std::vector<uint32_t>& ids);
  void place_all(const Scene& scene, uint32_t environment_count);
  bool follow(const Scene& scene, const std::vector<uint32_t>& slots, const std::vector<uint32_t>& deformed);
  [[nodiscard]] VkAccelerationStructureInstanceKHR record_of(uint32_t slot) const;
  void build_tops();

  std::shared_ptr<ks::Device> device_;
  RtBuilder builder_;
  std::shared_ptr<const void> scene_;  // its identity; null: none, or the last update failed
  MeshWatch watch_;
  std::unordered_map<uint32_t, Bottom> meshes_;              // by id
  std::vector<Placement> placements_;                        // by slot
  std::vector<std::vector<uint32_t>> seen_;                  // slots, by environment
  std::vector<VkAccelerationStructureInstanceKHR> records_;  // environment after environment, as in seen_
  uint64_t instances_revision_ = 0;
  uint32_t environment_count_ = 0;
  ArrayBuffer instances_{rt_input_usage}, top_storage_{rt_storage_usage, ArrayBuffer::Writer::device}, addresses_;
  std::vector<RtStructure> tops_;
};

}  // namespace kuafu
