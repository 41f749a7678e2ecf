// SPDX-License-Identifier: Apache-2.0
// The scene's meshes and instances as the stages see them: a record for each slot, and lists of materials. An instance that changes is
// written alone.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <memory>
#include <unordered_map>
#include <vector>

#include "frame/device_array.h"
#include "scene/mesh_watch.h"
#include "shared/scene_records.h"

namespace kuafu {

/// This table says where the vertices and triangles of the scene's meshes lie in the stages' memory.
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

/// Index of a scene's material in the materials' table, whose first entry is the default (for `none`).
inline uint32_t material_index(const Scene& scene, uint32_t id) { return slot_or_none(scene.materials(), id) + 1; }

class InstanceTable {
 public:
  void update(const Memory& memory, const Scene& scene, const MeshTable& meshes);
  void forget() { seen_ = 0; }
  [[nodiscard]] uint64_t records() const { return record_table_.address(); }
  [[nodiscard]] uint64_t materials() const { return material_table_.address(); }

 private:
  void write_all(const Memory& memory, const Scene& scene, const MeshTable& meshes);
  void set(const Scene& scene, const MeshTable& meshes, uint32_t slot);

  uint64_t seen_ = 0;                    // Revisions::instances
  std::vector<InstanceRecord> records_;  // by slot
  std::vector<uint32_t> capacities_;     // by slot, of its part of materials_
  std::vector<uint32_t> materials_;      // lists, each ended by the default for slots of the mesh beyond it
  size_t materials_when_written_ = 0;    // lists that outgrew their place leave gaps: too many, and all are written again
  MappedTable<InstanceRecord> record_table_;
  MappedTable<uint32_t> material_table_;
};

}  // namespace kuafu
