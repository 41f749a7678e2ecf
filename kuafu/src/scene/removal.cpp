// SPDX-License-Identifier: Apache-2.0
// What leaves a scene: its memory is freed, its id stays taken. What something else still uses is refused by the user's name.
#include <algorithm>

#include "device/error.h"
#include "scene/scene.h"
#include "scene/table.h"

namespace kuafu {
namespace {

template <class T>
void take_out(T& entry) {
  entry = T{};
  entry.removed = true;
}

[[noreturn]] void fail_used(const char* kind, uint32_t id, const std::string& name, const char* by, size_t user,
                            const std::string& user_name, const char* what_to_do) {
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s %u '%s' is used by %s %zu '%s': %s first", kind, id + 1, name.c_str(), by, user + 1,
           user_name.c_str(), what_to_do);
}

bool uses(const Material& m, uint32_t texture) {
  return std::ranges::any_of(texture_ids(m), [&](const uint32_t* id) { return *id == texture; });
}

}  // namespace

void Scene::remove_mesh(uint32_t id) {
  Mesh& mesh = there(meshes_, "mesh", id);
  for (size_t i = 0; i < instances_.size(); ++i)
    if (instances_[i] && instances_[i]->mesh == id) fail_used("mesh", id, mesh.name, "instance", i, instances_[i]->name, "remove that");
  take_out(mesh);
  mesh_bounds_[id] = {};
  ++revisions_.meshes;
}

void Scene::remove_material(uint32_t id) {
  Material& material = there(materials_, "material", id);
  for (size_t i = 0; i < instances_.size(); ++i)
    if (instances_[i] && std::ranges::find(instances_[i]->materials, id) != instances_[i]->materials.end())
      fail_used("material", id, material.name, "instance", i, instances_[i]->name, "give that another one, or remove it,");
  take_out(material);
  ++revisions_.materials;
}

void Scene::remove_texture(uint32_t id) {
  Texture& texture = there(textures_, "texture", id);
  for (size_t i = 0; i < materials_.size(); ++i)
    if (!materials_[i].removed && uses(materials_[i], id))
      fail_used("texture", id, texture.name, "material", i, materials_[i].name, "change or remove that");
  for (size_t i = 0; i < lights_.size(); ++i)
    if (lights_[i] && lights_[i]->texture == id)
      fail_used("texture", id, texture.name, "light", i, lights_[i]->name, "change or remove that");
  if (environment_.texture == id) fail_used("texture", id, texture.name, "environment", 0, "", "set another one");
  const uint64_t revision = texture.revision;
  take_out(texture);
  texture.revision = revision + 1;
  ++revisions_.textures;
}

void Scene::remove_instance(uint32_t id) {
  const uint32_t slot = live(instances_, "instance", id).slot;
  moving_instances_ -= instances_[id]->velocity.moves();
  instances_[id].reset();
  instance_slots_[slot] = none;
  free_slots_.push_back(slot);
  note_instance(slot);
}

void Scene::remove_light(uint32_t id) {
  live(lights_, "light", id);
  lights_[id].reset();
  ++revisions_.lights;
}

}  // namespace kuafu
