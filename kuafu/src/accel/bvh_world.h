// The scene as our own tracer knows it, in device memory: a BVH2 per mesh, built once or refitted, and a top level per environment.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include "accel/array_buffer.h"
#include "accel/mesh_bvh.h"
#include "accel/mesh_watch.h"
#include "accel/placement.h"

namespace kuafu {

class BvhWorld {
 public:
  explicit BvhWorld(std::shared_ptr<ks::Device> device) : device_(std::move(device)) {}

  void update(const Scene& scene, uint32_t environment_count);
  /// 0 until a scene was seen.
  [[nodiscard]] uint32_t environment_count() const { return environment_count_; }
  // Device addresses of arrays (shared/bvh_node.h).
  [[nodiscard]] uint64_t roots() const { return roots_.address(); }  // child code of each environment's top level
  [[nodiscard]] uint64_t nodes() const { return nodes_.address(); }  // of all top levels
  [[nodiscard]] uint64_t instances() const { return instances_.address(); }

 private:
  /// A mesh whose vertices moved once is expected to move again: the host keeps its tree, and it has device memory of its own.
  struct Deforming {
    MeshBvh bvh;
    double cost_when_built = 0.0;
    ArrayBuffer block;
  };
  struct PlacedMesh {
    uint64_t nodes, triangles;  // device addresses
    Box bounds;
    std::unique_ptr<Deforming> deforming;
  };

  void forget();
  void add_meshes(const Scene& scene);
  void deform(const Mesh& mesh, PlacedMesh& placed) const;
  void upload(PlacedMesh& placed) const;
  void place(std::vector<Placement> placements, uint32_t environment_count);

  std::shared_ptr<ks::Device> device_;
  const Scene* scene_ = nullptr;
  MeshWatch watch_;
  std::vector<ArrayBuffer> blocks_;  // bottom levels of meshes that do not deform
  std::vector<PlacedMesh> meshes_;
  std::vector<Placement> placements_;
  uint64_t instances_revision_ = 0;
  uint32_t environment_count_ = 0;
  ArrayBuffer nodes_, instances_, roots_;
};

}  // namespace kuafu
