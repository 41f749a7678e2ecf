// SPDX-License-Identifier: Apache-2.0
#include "scene/scene.h"

#include <algorithm>
#include <iterator>

#include "device/error.h"
#include "scene/rig.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

Bounds bounds_of(const std::vector<glm::vec3>& positions) {
  Bounds bounds;
  for (const glm::vec3& position : positions) {
    bounds.min = glm::min(bounds.min, glm::dvec3(position));
    bounds.max = glm::max(bounds.max, glm::dvec3(position));
  }
  return bounds;
}

void shift(uint32_t& id, size_t base) {
  if (id != none) id += static_cast<uint32_t>(base);
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
    if (ids[i] != none && ids[i] >= materials_.ids_given())
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "materials[%zu] is %u, but the scene has %zu materials", i, ids[i] + 1, materials_.size());
    else if (ids[i] != none && !materials_.has(ids[i]))
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "materials[%zu] is %u, which was removed", i, ids[i] + 1);
}

uint32_t Scene::add_mesh(Mesh mesh) {
  check(mesh);
  mesh.bounds = bounds_of(mesh.positions);
  ++revisions_.meshes;
  return meshes_.add(std::move(mesh));
}

uint32_t Scene::add_texture(Texture texture) {
  check(texture);
  ++revisions_.textures;
  return textures_.add(std::move(texture));
}

uint32_t Scene::add_material(Material material) {
  check(material);
  check_references(material);
  ++revisions_.materials;
  return materials_.add(std::move(material));
}

uint32_t Scene::add_instance(Instance instance) {
  check_exists("instance", instance.name, "mesh", instance.mesh, meshes_);
  check_materials(instance.materials);
  check_affine(instance.local_to_world, ("instance '" + instance.name + "': local_to_world").c_str());
  instance.previous_local_to_world = instance.local_to_world;
  check_velocity("instance", instance.name, instance.velocity);
  const bool moves = instance.velocity.moves();
  const uint32_t id = instances_.add(std::move(instance));
  moving_instances_ += moves;
  note_instance(instances_.slot(id));
  return id;
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
  ++revisions_.lights;
  return lights_.add(std::move(light));
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
  mesh.bounds = bounds_of(positions);
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
    check_affine(local_to_world[i], ("instance '" + there(instances_, "instance", ids[i]).name + "': local_to_world").c_str());
  for (size_t i = 0; i < ids.size(); ++i) {
    Instance& instance = instances_[ids[i]];
    instance.local_to_world = local_to_world[i];
    if (!instance.moved) moved_.push_back(ids[i]);
    instance.moved = true;
    note_instance(instances_.slot(ids[i]));
  }
}

void Scene::next_frame() {
  for (const uint32_t id : moved_) {
    if (!instances_.has(id)) continue;
    instances_[id].previous_local_to_world = instances_[id].local_to_world;
    instances_[id].moved = false;
  }
  moved_.clear();
}

void Scene::set_instance_velocity(uint32_t id, const Twist& velocity) {
  Instance& instance = there(instances_, "instance", id);
  check_velocity("instance", instance.name, velocity);
  moving_instances_ += velocity.moves();
  moving_instances_ -= instance.velocity.moves();
  instance.velocity = velocity;
  note_instance(instances_.slot(id));
}

void Scene::set_instance_materials(uint32_t id, std::vector<uint32_t> materials) {
  Instance& instance = there(instances_, "instance", id);
  check_materials(materials);
  instance.materials = std::move(materials);
  note_instance(instances_.slot(id));
}

void Scene::set_lights(std::span<const uint32_t> ids, std::span<Light> lights) {
  for (size_t i = 0; i < ids.size(); ++i) {
    const Light& old = there(lights_, "light", ids[i]);
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
  meshes_.make_room(other.meshes_.ids_given());
  textures_.make_room(other.textures_.ids_given());
  materials_.make_room(other.materials_.ids_given());
  instances_.make_room(other.instances_.ids_given());
  lights_.make_room(other.lights_.ids_given());
  grow(cameras_, other.cameras_);
  grow(rigs_, other.rigs_);
  for (auto& m : other.materials_) {
    if (!m) continue;
    for (uint32_t* texture : texture_ids(*m)) shift(*texture, textures_.ids_given());
  }
  for (auto& instance : other.instances_) {
    if (!instance) continue;
    shift(instance->mesh, meshes_.ids_given());
    for (uint32_t& material : instance->materials) shift(material, materials_.ids_given());
  }
  for (auto& light : other.lights_)
    if (light) shift(light->texture, textures_.ids_given());
  for (const auto& rig : other.rigs_) {
    auto moved = std::make_shared<Rig>(*rig);
    for (RigMesh& mesh : moved->meshes) shift(mesh.mesh, meshes_.ids_given());
    for (RigMember& member : moved->members)
      shift(member.id, member.kind == RigMember::Kind::instance ? instances_.ids_given()
                       : member.kind == RigMember::Kind::light  ? lights_.ids_given()
                                                                : cameras_.size());
    rigs_.push_back(std::move(moved));
  }
  revisions_.meshes += !other.meshes_.empty();
  revisions_.textures += !other.textures_.empty();
  revisions_.materials += !other.materials_.empty();
  revisions_.lights += !other.lights_.empty();
  moving_instances_ += other.moving_instances_;
  const auto first_instance = uint32_t(instances_.ids_given());
  meshes_.append(std::move(other.meshes_));
  textures_.append(std::move(other.textures_));
  materials_.append(std::move(other.materials_));
  instances_.append(std::move(other.instances_));
  lights_.append(std::move(other.lights_));
  for (uint32_t id = first_instance; id < instances_.ids_given(); ++id)
    if (instances_.has(id)) note_instance(instances_.slot(id));
  std::move(other.cameras_.begin(), other.cameras_.end(), std::back_inserter(cameras_));
}

Bounds Scene::bounds() const {
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

Bounds Scene::rough_bounds() const {
  Bounds bounds;
  for (const auto& instance : instances_) {
    if (!instance || meshes_[instance->mesh].positions.empty()) continue;
    const Bounds& local = meshes_[instance->mesh].bounds;
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
