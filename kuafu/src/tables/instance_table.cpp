// SPDX-License-Identifier: Apache-2.0
#include "tables/instance_table.h"

#include <algorithm>
#include <cmath>

namespace kuafu {
namespace {

void set_transform(InstanceRecord& record, const glm::dmat4& local_to_world) {
  const glm::dmat4 rows = glm::transpose(local_to_world);
  const glm::dmat3 linear(local_to_world);
  // Columns of the inverse are rows of its transpose; scaled so that a normal stays in range whatever the instance's scale.
  const glm::dmat3 inverse = glm::inverse(linear);
  double largest = 0;
  for (int c = 0; c < 3; ++c) largest = std::max(largest, glm::length(inverse[c]));
  const double scale = std::isfinite(largest) && largest > 0 ? 1 / largest : 1;
  const glm::dmat3 normal_rows = inverse * scale;  // element (row r, column c) of the inverse transpose is inverse[r][c]
  for (int i = 0; i < 3; ++i) {
    record.local_to_world[i] = glm::vec4(rows[i]);
    record.normal_to_world[i] = glm::vec3(normal_rows[i]);
  }
}

}  // namespace

void MeshTable::update(const Memory& memory, const Scene& scene) {
  const MeshWatch::Changes changes = watch_.look(scene);
  for (const uint32_t id : changes.deformed) move_vertices(memory, scene.meshes()[id], meshes_[id]);
  for (const uint32_t id : changes.removed) meshes_.erase(id);
  if (!changes.added.empty()) add(memory, scene, changes.added);
}

void MeshTable::add(const Memory& memory, const Scene& scene, const std::vector<uint32_t>& ids) {
  Block block;
  for (const uint32_t id : ids) {
    const Mesh& m = scene.meshes()[id];
    Addresses& a = meshes_[id];
    a.positions = block.add(m.positions);
    a.normals = block.add(m.normals);
    a.uvs = block.add(m.uvs);
    a.uvs_1 = block.add(m.uvs_1);
    a.colors = block.add(m.colors);
    a.tangents = block.add(m.tangents);
    a.indices = block.add(m.indices);
    a.slots = block.add(m.slots);
    a.flags = (m.normals.empty() ? 0 : instance_has_normals) | (m.uvs.empty() ? 0 : instance_has_uvs) |
              (m.slots.empty() ? 0 : instance_has_slots) | (m.uvs_1.empty() ? 0 : instance_has_uvs_1) |
              (m.colors.empty() ? 0 : instance_has_colors) | (m.tangents.empty() ? 0 : instance_has_tangents);
  }
  const auto buffer = block.upload(memory.device);
  for (const uint32_t id : ids) {
    Addresses& a = meshes_[id];
    for (uint64_t* offset : {&a.positions, &a.normals, &a.uvs, &a.uvs_1, &a.colors, &a.tangents, &a.indices, &a.slots})
      *offset += memory.address(*buffer);
    a.block = buffer;
  }
}

void MeshTable::move_vertices(const Memory& memory, const Mesh& mesh, const Addresses& a) {
  const uint64_t base = memory.address(*a.block);
  a.block->write(a.positions - base, mesh.positions.data(), mesh.positions.size() * sizeof(glm::vec3));
  if (!mesh.normals.empty()) a.block->write(a.normals - base, mesh.normals.data(), mesh.normals.size() * sizeof(glm::vec3));
  if (!mesh.tangents.empty()) a.block->write(a.tangents - base, mesh.tangents.data(), mesh.tangents.size() * sizeof(glm::vec4));
}

void InstanceTable::update(const Memory& memory, const Scene& scene, const MeshTable& meshes) {
  const auto changes = scene.instance_changes(seen_);
  const size_t most = scene.instance_slots().size() / 2 + 16, most_materials = 2 * materials_when_written_ + 4096;
  if (!changes || changes->size() > most || materials_.size() > most_materials) {
    write_all(memory, scene, meshes);
  } else {
    records_.resize(scene.instance_slots().size());
    capacities_.resize(records_.size());
    for (const uint32_t slot : *changes) {
      set(scene, meshes, slot);
      record_table_.write(memory, records_, slot, 1);
      material_table_.write(memory, materials_, records_[slot].first_material, capacities_[slot]);
    }
  }
  seen_ = scene.revisions().instances;
}

void InstanceTable::write_all(const Memory& memory, const Scene& scene, const MeshTable& meshes) {
  records_.assign(scene.instance_slots().size(), {});
  capacities_.assign(records_.size(), 0);
  materials_.clear();
  for (uint32_t slot = 0; slot < records_.size(); ++slot) set(scene, meshes, slot);
  materials_when_written_ = materials_.size();
  record_table_.write(memory, records_, 0, records_.size());
  material_table_.write(memory, materials_, 0, materials_.size());
}

void InstanceTable::set(const Scene& scene, const MeshTable& meshes, uint32_t slot) {
  const uint32_t id = scene.instance_slots()[slot];
  if (id == none) return;  // no hit names it
  const Instance& instance = scene.instances()[id];
  const MeshTable::Addresses& mesh = meshes[instance.mesh];
  InstanceRecord& r = records_[slot];
  r.positions = mesh.positions;
  r.normals = mesh.normals;
  r.uvs = mesh.uvs;
  r.uvs_1 = mesh.uvs_1;
  r.colors = mesh.colors;
  r.tangents = mesh.tangents;
  r.indices = mesh.indices;
  r.slots = mesh.slots;
  r.flags = mesh.flags;
  r.id = id;
  r.semantic_id = instance.semantic_id;
  set_transform(r, instance.local_to_world);
  const auto count = uint32_t(instance.materials.size());
  r.material_count = count;
  if (count + 1 > capacities_[slot]) {
    r.first_material = uint32_t(materials_.size());
    capacities_[slot] = count + 1;
    materials_.resize(materials_.size() + count + 1);
  }
  for (uint32_t i = 0; i < count; ++i) materials_[r.first_material + i] = material_index(scene, instance.materials[i]);
  materials_[r.first_material + count] = material_index(scene, none);
}

}  // namespace kuafu
