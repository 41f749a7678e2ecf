// SPDX-License-Identifier: Apache-2.0
// The scene's instances as the stages see them: a record for each slot, and lists of materials. An instance that changes is written alone.
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <vector>

#include "tables/mesh_table.h"

namespace kuafu {

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
