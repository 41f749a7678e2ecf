// The scene as Embree knows it: one bottom scene per mesh, built once or refitted, and one top scene per environment over instances of
// them. Thread rule: externally synchronised; tracing the top scenes is allowed from many threads.
#pragma once

#include <vector>

#include "accel/embree_handle.h"
#include "accel/mesh_watch.h"
#include "accel/placement.h"

namespace kuafu {

class EmbreeWorld {
 public:
  struct Environment {
    EmbreeScene scene;
    std::vector<uint32_t> instances;  // Embree's instID -> index of the placement
  };

  /// Builds what is new, moves what moved, and commits the top scenes concerned. New meshes are appended to known ones.
  void update(const Scene& scene, uint32_t environment_count);
  [[nodiscard]] const std::vector<Environment>& environments() const { return environments_; }

 private:
  struct Bottom {
    EmbreeScene scene;
    EmbreeGeometry geometry;  // null for a mesh without triangles
    bool refittable = false;
    uint32_t refits = 0;
  };

  void forget();
  void add_mesh(const Mesh& mesh);
  void deform(const Mesh& mesh, Bottom& bottom);
  [[nodiscard]] bool only_moved(const std::vector<Placement>& placements) const;
  void move(const std::vector<Placement>& placements, const std::vector<uint32_t>& deformed);
  void place(const std::vector<Placement>& placements, uint32_t environment_count);

  EmbreeDevice device_;
  const Scene* scene_ = nullptr;
  uint64_t instances_revision_ = 0;
  MeshWatch watch_;
  std::vector<Bottom> meshes_;
  std::vector<Placement> placements_;
  std::vector<EmbreeGeometry> geometries_;  // per placement; null where it is not traceable
  std::vector<Environment> environments_;
};

}  // namespace kuafu
