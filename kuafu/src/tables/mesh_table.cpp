// SPDX-License-Identifier: Apache-2.0
#include "tables/mesh_table.h"

namespace kuafu {

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

}  // namespace kuafu
