// SPDX-License-Identifier: Apache-2.0
#include "scene/scene.h"

#include <algorithm>
#include <iterator>

#include "device/error.h"
#include "scene/rig.h"
#include "scene/table.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

Scene::Bounds bounds_of(const std::vector<glm::vec3>& positions) {
  Scene::Bounds bounds;
  for (const glm::vec3& position : positions) {
    bounds.min = glm::min(bounds.min, glm::dvec3(position));
    bounds.max = glm::max(bounds.max, glm::dvec3(position));
  }
  return bounds;
}

/// Adds and returns the id.
template <class Table, class T>
uint32_t add(Table& table, T&& value, uint64_t& revision) {
  if (table.size() >= none) ks::fail(KS_ERROR_UNSUPPORTED, "a scene table is full (2^32 - 1 ids)");
  table.emplace_back(std::forward<T>(value));
  ++revision;
  return static_cast<uint32_t>(table.size() - 1);
}

void shift(uint32_t& id, size_t base) {
  if (id != none) id += static_cast<uint32_t>(base);
}

template <class T>
void move_to_end(std::vector<T>& to, std::vector<T>& from, uint64_t& revision) {
  if (!from.empty()) ++revision;
  std::move(from.begin(), from.end(), std::back_inserter(to));
  from.clear();
}

}  // namespace

void Scene::check_references(const Material& m) const {
  for (const uint32_t* texture : texture_ids(m))
    if (*texture != none) check_exists("material", m.name, "texture", *texture, textures_);
}

void Scene::check_references(const Light& light) const {
  if (light.kind == Light::Kind::projector && light.dots.dots.empty()) {
    check_exists("projector", light.name, "texture", light.texture, textures_);
  } else if (light.texture != none) {
    check_exists("light", light.name, "texture", light.texture, textures_);
  }
}

void Scene::check_references(const Environment& environment) const {
  if (environment.texture != none) check_exists("environment", "", "texture", environment.texture, textures_);
}

void Scene::check_materials(const std::vector<uint32_t>& ids) const {
  for (size_t i = 0; i < ids.size(); ++i)
    if (ids[i] != none && ids[i] >= materials_.size())
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "materials[%zu] is %u, but the scene has %zu materials", i, ids[i] + 1, materials_.size());
    else if (ids[i] != none && materials_[ids[i]].removed)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "materials[%zu] is %u, which was removed", i, ids[i] + 1);
}

uint32_t Scene::add_mesh(Mesh mesh) {
  check(mesh);
  mesh_bounds_.push_back(bounds_of(mesh.positions));
  return add(meshes_, std::move(mesh), revisions_.meshes);
}

uint32_t Scene::add_texture(Texture texture) {
  check(texture);
  return add(textures_, std::move(texture), revisions_.textures);
}

uint32_t Scene::add_material(Material material) {
  check(material);
  check_references(material);
  return add(materials_, std::move(material), revisions_.materials);
}

uint32_t Scene::add_instance(Instance instance) {
  check_exists("instance", instance.name, "mesh", instance.mesh, meshes_);
  check_materials(instance.materials);
  check_affine(instance.local_to_world, ("instance '" + instance.name + "': local_to_world").c_str());
  instance.previous_local_to_world = instance.local_to_world;
  check_velocity("instance", instance.name, instance.velocity);
  const uint32_t id = add(instances_, std::move(instance), revisions_.instances);
  take_slot(id);
  return id;
}

void Scene::take_slot(uint32_t id) {
  if (free_slots_.empty()) {
    free_slots_.push_back(uint32_t(instance_slots_.size()));
    instance_slots_.push_back(none);
  }
  const uint32_t slot = free_slots_.back();
  free_slots_.pop_back();
  instance_slots_[slot] = id;
  instances_[id]->slot = slot;
  moving_instances_ += instances_[id]->velocity.moves();
  note_instance(slot);
}

void Scene::note_instance(uint32_t slot) {
  instance_log_.note(slot);
  revisions_.instances = instance_log_.revision();
}

const Texture& pattern_of(const Scene& scene, const Light& light) { return light.raster ? *light.raster : scene.textures()[light.texture]; }

uint32_t Scene::add_light(Light light) {
  check(light);
  check_references(light);
  if (!light.dots.dots.empty()) light.raster = std::make_shared<const Texture>(rasterise(light.dots));
  return add(lights_, std::move(light), revisions_.lights);
}

void Scene::update_mesh_positions(uint32_t id, std::vector<glm::vec3> positions, std::vector<glm::vec3> normals,
                                  std::vector<glm::vec4> tangents) {
  const Mesh& mesh = there(meshes_, "mesh", id);
  const char* name = mesh.name.c_str();
  if (positions.size() != mesh.positions.size())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu positions for its %zu vertices", name, positions.size(), mesh.positions.size());
  if (normals.size() != mesh.normals.size())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu normals, it was made with %zu", name, normals.size(), mesh.normals.size());
  if (!tangents.empty() && tangents.size() != mesh.tangents.size())
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "mesh '%s': %zu tangents, it was made with %zu", name, tangents.size(), mesh.tangents.size());
  check_vertices(mesh.name, positions, normals);
  move_vertices(id, std::move(positions), std::move(normals), std::move(tangents));
}

void Scene::move_vertices(uint32_t id, std::vector<glm::vec3> positions, std::vector<glm::vec3> normals, std::vector<glm::vec4> tangents) {
  Mesh& mesh = meshes_[id];
  mesh_bounds_[id] = bounds_of(positions);
  mesh.positions = std::move(positions);
  mesh.normals = std::move(normals);
  if (!tangents.empty()) mesh.tangents = std::move(tangents);
  ++mesh.deformation;
  ++revisions_.meshes;
}

void Scene::set_texture(uint32_t id, Texture texture) {
  Texture& old = there(textures_, "texture", id);
  check(texture);
  texture.revision = old.revision + 1;
  old = std::move(texture);
  ++revisions_.textures;
}

void Scene::set_material(uint32_t id, Material material) {
  Material& old = there(materials_, "material", id);
  check(material);
  check_references(material);
  old = std::move(material);
  ++revisions_.materials;
}

void Scene::set_instance_poses(std::span<const uint32_t> ids, std::span<const glm::dmat4> local_to_world) {
  for (size_t i = 0; i < ids.size(); ++i)
    check_affine(local_to_world[i], ("instance '" + live(instances_, "instance", ids[i]).name + "': local_to_world").c_str());
  for (size_t i = 0; i < ids.size(); ++i) {
    Instance& instance = *instances_[ids[i]];
    instance.local_to_world = local_to_world[i];
    if (!instance.moved) moved_.push_back(ids[i]);
    instance.moved = true;
    note_instance(instance.slot);
  }
}

void Scene::next_frame() {
  for (const uint32_t id : moved_) {
    if (!instances_[id]) continue;
    instances_[id]->previous_local_to_world = instances_[id]->local_to_world;
    instances_[id]->moved = false;
  }
  moved_.clear();
}

void Scene::set_instance_velocity(uint32_t id, const Twist& velocity) {
  Instance& instance = live(instances_, "instance", id);
  check_velocity("instance", instance.name, velocity);
  moving_instances_ += velocity.moves();
  moving_instances_ -= instance.velocity.moves();
  instance.velocity = velocity;
  note_instance(instance.slot);
}

void Scene::set_instance_materials(uint32_t id, std::vector<uint32_t> materials) {
  Instance& instance = live(instances_, "instance", id);
  check_materials(materials);
  instance.materials = std::move(materials);
  note_instance(instance.slot);
}

void Scene::set_lights(std::span<const uint32_t> ids, std::span<Light> lights) {
  for (size_t i = 0; i < ids.size(); ++i) {
    const Light& old = live(lights_, "light", ids[i]);
    Light& light = lights[i];
    check(light);
    check_references(light);
    light.raster = nullptr;
    if (!light.dots.dots.empty())  // a light that only moves keeps its image
      light.raster = light.dots == old.dots ? old.raster : std::make_shared<const Texture>(rasterise(light.dots));
  }
  for (size_t i = 0; i < ids.size(); ++i) lights_[ids[i]] = std::move(lights[i]);
  ++revisions_.lights;
}

void Scene::set_environment(const Environment& environment) {
  check(environment);
  check_references(environment);
  environment_ = environment;
  ++revisions_.lights;
}

void Scene::set_medium(const std::optional<Medium>& medium) {
  if (medium) check(*medium);
  medium_ = medium;
  ++revisions_.lights;
}

void Scene::add_camera(Camera camera) {
  check(camera);
  cameras_.push_back(std::move(camera));
}

void Scene::append(Scene&& other) {
  // All memory is taken first, so that a failure leaves this scene as it was.
  const auto grow = [](auto& to, const auto& from) {
    if (to.capacity() < to.size() + from.size()) to.reserve(std::max(2 * to.size(), to.size() + from.size()));
  };
  grow(meshes_, other.meshes_);
  grow(textures_, other.textures_);
  grow(materials_, other.materials_);
  grow(instances_, other.instances_);
  grow(mesh_bounds_, other.mesh_bounds_);
  grow(instance_slots_, other.instance_slots_);
  free_slots_.reserve(free_slots_.size() + 1);
  grow(lights_, other.lights_);
  grow(cameras_, other.cameras_);
  grow(rigs_, other.rigs_);
  for (Material& m : other.materials_)
    for (uint32_t* texture : texture_ids(m)) shift(*texture, textures_.size());
  for (auto& instance : other.instances_) {
    if (!instance) continue;
    shift(instance->mesh, meshes_.size());
    for (uint32_t& material : instance->materials) shift(material, materials_.size());
  }
  for (auto& light : other.lights_)
    if (light) shift(light->texture, textures_.size());
  for (const auto& rig : other.rigs_) {
    auto moved = std::make_shared<Rig>(*rig);
    for (RigMesh& mesh : moved->meshes) shift(mesh.mesh, meshes_.size());
    for (RigMember& member : moved->members)
      shift(member.id, member.kind == RigMember::Kind::instance ? instances_.size()
                       : member.kind == RigMember::Kind::light  ? lights_.size()
                                                                : cameras_.size());
    rigs_.push_back(std::move(moved));
  }
  const size_t first_instance = instances_.size();
  std::ranges::copy(other.mesh_bounds_, std::back_inserter(mesh_bounds_));
  move_to_end(meshes_, other.meshes_, revisions_.meshes);
  move_to_end(textures_, other.textures_, revisions_.textures);
  move_to_end(materials_, other.materials_, revisions_.materials);
  move_to_end(instances_, other.instances_, revisions_.instances);
  for (size_t id = first_instance; id < instances_.size(); ++id)
    if (instances_[id]) take_slot(uint32_t(id));
  move_to_end(lights_, other.lights_, revisions_.lights);
  std::move(other.cameras_.begin(), other.cameras_.end(), std::back_inserter(cameras_));
}

Scene::Bounds Scene::bounds() const {
  Bounds bounds;
  for (const auto& instance : instances_) {
    if (!instance) continue;
    for (const glm::vec3& position : meshes_[instance->mesh].positions) {
      const glm::dvec3 world(instance->local_to_world * glm::dvec4(position, 1.0));
      bounds.min = glm::min(bounds.min, world);
      bounds.max = glm::max(bounds.max, world);
    }
  }
  return bounds;
}

Scene::Bounds Scene::rough_bounds() const {
  Bounds bounds;
  for (const auto& instance : instances_) {
    if (!instance || meshes_[instance->mesh].positions.empty()) continue;
    const Bounds& local = mesh_bounds_[instance->mesh];
    for (int corner = 0; corner < 8; ++corner) {
      const glm::dvec4 p(corner & 1 ? local.max.x : local.min.x, corner & 2 ? local.max.y : local.min.y,
                         corner & 4 ? local.max.z : local.min.z, 1.0);
      const glm::dvec3 world(instance->local_to_world * p);
      bounds.min = glm::min(bounds.min, world);
      bounds.max = glm::max(bounds.max, world);
    }
  }
  return bounds;
}

}  // namespace kuafu
