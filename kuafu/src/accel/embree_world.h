// SPDX-License-Identifier: Apache-2.0
// The scene as Embree knows it: one bottom scene per mesh, built once or refitted, and per environment a top scene over instances of them,
// and a second one over the few that moved since, so that a large one need not be built for each. Thread rule: externally synchronised;
// tracing the top scenes is allowed from many threads.
#pragma once

#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "accel/embree_handle.h"
#include "accel/placement.h"
#include "scene/mesh_watch.h"

namespace kuafu {

class EmbreeWorld {
 public:
  struct Environment {
    EmbreeScene scene;
    EmbreeScene apart;                              // of instances that moved since `scene` was built; null where none did
    std::vector<uint32_t> instances;                // Embree's instID -> slot, the same in both scenes
    std::unordered_map<uint32_t, uint32_t> places;  // slot -> instID
  };

  /// Builds new meshes, moves instances, and commits the top scenes concerned. A commit takes Embree's own time per instance, which is
  /// short.
  void update(const Scene& scene, uint32_t environment_count, const TimeSpan& open);
  /// Whether Embree has code for this machine that takes 16 rays at once.
  [[nodiscard]] bool takes_16_rays() const { return takes_16_rays_; }
  /// The times that Embree's 0..1 stands for; an instant if nothing moves.
  [[nodiscard]] const TimeSpan& times() const { return times_; }
  [[nodiscard]] const std::vector<Environment>& environments() const { return environments_; }

 private:
  struct Bottom {
    EmbreeScene scene;
    EmbreeGeometry geometry;  // null for a mesh without triangles
    bool refittable = false;
    uint32_t refits = 0;
    bool filtered = false;  // for cutouts
  };

  void forget();
  std::vector<uint32_t> follow_meshes(const Scene& scene);
  void follow_cutouts(const Scene& scene);
  void add_mesh(const Scene& scene, uint32_t id);
  void deform(const Mesh& mesh, Bottom& bottom);
  void place_all(const Scene& scene, uint32_t environment_count);
  void attach_all(uint32_t environment_count);
  void follow(const Scene& scene, const std::vector<uint32_t>& slots);
  [[nodiscard]] bool fit_apart(const std::vector<uint32_t>& slots) const;
  void take_apart(uint32_t slot);
  void follow_apart(const Scene& scene, const std::vector<uint32_t>& slots);
  bool put(uint32_t slot, const Placement& placement);
  static void follow_in(Environment& environment, uint32_t slot, RTCGeometry geometry);

  EmbreeDevice device_;
  bool takes_16_rays_ = rtcGetDeviceProperty(device_.handle(), RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  std::shared_ptr<const void> scene_;  // its identity; null: none, or the last update failed
  uint64_t instances_revision_ = 0;
  TimeSpan times_;
  MeshWatch watch_;
  std::unordered_map<uint32_t, Bottom> meshes_;  // by id
  Revisions cutouts_seen_{0, 0, 0, 0, 0};
  std::unordered_set<uint32_t> cutouts_;  // meshes_with_cutouts
  // By slot.
  std::vector<Placement> placements_;
  std::vector<EmbreeGeometry> geometries_;  // null where it is not traceable
  std::vector<bool> apart_;
  uint32_t apart_count_ = 0;
  EmbreeScene nothing_;  // what instances show in `scene` once they are apart
  std::vector<Environment> environments_;
};

}  // namespace kuafu
