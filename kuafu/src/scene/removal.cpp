// SPDX-License-Identifier: Apache-2.0
// Removal from a scene: memory is freed, and the id is never given again. An object in use is refused with its user's name.
#include <algorithm>

#include "device/error.h"
#include "scene/scene.h"

namespace kuafu {
namespace {

[[noreturn]] void fail_used(const char* kind, uint32_t id, const std::string& name, const char* by, uint32_t user,
                            const std::string& user_name, const char* what_to_do) {
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s %u '%s' is used by %s %u '%s': %s first", kind, id + 1, name.c_str(), by, user + 1,
           user_name.c_str(), what_to_do);
}

bool uses(const Material& m, uint32_t texture) {
  return std::ranges::any_of(texture_ids(m), [&](const uint32_t* id) { return *id == texture; });
}

}  // namespace

void Scene::remove_mesh(uint32_t id) {
  const Mesh& mesh = there(meshes_, "mesh", id);
  for (const uint32_t i : instances_.ids())
    if (i != none && instances_[i].mesh == id) fail_used("mesh", id, mesh.name, "instance", i, instances_[i].name, "remove that");
  meshes_.remove(id);
  ++revisions_.meshes;
}

void Scene::remove_material(uint32_t id) {
  const Material& material = there(materials_, "material", id);
  for (const uint32_t i : instances_.ids())
    if (i != none && std::ranges::find(instances_[i].materials, id) != instances_[i].materials.end())
      fail_used("material", id, material.name, "instance", i, instances_[i].name, "give that another one, or remove it,");
  materials_.remove(id);
  ++revisions_.materials;
}

void Scene::remove_texture(uint32_t id) {
  const Texture& texture = there(textures_, "texture", id);
  for (const uint32_t i : materials_.ids())
    if (i != none && uses(materials_[i], id))
      fail_used("texture", id, texture.name, "material", i, materials_[i].name, "change or remove that");
  for (const uint32_t i : lights_.ids())
    if (i != none && lights_[i].texture == id) fail_used("texture", id, texture.name, "light", i, lights_[i].name, "change or remove that");
  if (environment_.texture == id) fail_used("texture", id, texture.name, "environment", 0, "", "set another one");
  textures_.remove(id);
  ++revisions_.textures;
}

void Scene::remove_instance(uint32_t id) {
  moving_instances_ -= there(instances_, "instance", id).velocity.moves();
  note_instance(instances_.slot(id));
  instances_.remove(id);
}

void Scene::remove_light(uint32_t id) {
  there(lights_, "light", id);
  lights_.remove(id);
  ++revisions_.lights;
}

}  // namespace kuafu
