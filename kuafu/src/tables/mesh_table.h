// SPDX-License-Identifier: Apache-2.0
// This table says where the vertices and triangles of the scene's meshes lie in the stages' memory. Thread rule: externally synchronised;
// no work may be in flight during update.
#pragma once

#include <memory>
#include <unordered_map>
#include <vector>

#include "frame/device_array.h"
#include "scene/mesh_watch.h"
#include "shared/scene_records.h"

namespace kuafu {

class MeshTable {
 public:
  /// A mesh's addresses, which stay as long as the mesh lives.
  struct Addresses {
    uint64_t positions = 0, normals = 0, uvs = 0, uvs_1 = 0, colors = 0, tangents = 0, indices = 0, slots = 0;
    uint32_t flags = 0;                 // instance_has_*
    std::shared_ptr<ks::Buffer> block;  // where they lie, with meshes of the same time; freed with the last of them
  };

  /// Uploads new and deformed meshes, and drops removed ones.
  void update(const Memory& memory, const Scene& scene);
  void forget() { meshes_.clear(), watch_.forget(); }
  [[nodiscard]] const Addresses& operator[](uint32_t mesh) const { return meshes_.at(mesh); }

 private:
  void add(const Memory& memory, const Scene& scene, const std::vector<uint32_t>& ids);
  static void move_vertices(const Memory& memory, const Mesh& mesh, const Addresses& addresses);

  MeshWatch watch_;
  std::unordered_map<uint32_t, Addresses> meshes_;  // by id
};

}  // namespace kuafu
