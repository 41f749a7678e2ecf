// SPDX-License-Identifier: Apache-2.0
// The scene functions of kuafu's C API: each reads its structs, calls Scene, and turns errors into statuses.
#include <algorithm>
#include <cmath>

#include "api/descriptors.h"
#include "api/handles.h"
#include "api/struct_table.h"
#include "device/interrupt.h"
#include "device/struct_read.h"
#include "device/struct_table.h"
#include "io/load.h"
#include "scene/rig.h"
#include "scene/table.h"

namespace {

const kuafu::Scene& scene_of(kuafu_scene handle) { return ks::object_of(handle, "scene")->scene; }

/// A scene for one call that changes it: refused while another call is in it, or a submitted render reads it.
struct Changeable {
  explicit Changeable(kuafu_scene handle) : owner(handle, "scene") {
    if (const uint32_t renders = owner->submitted_renders; renders > 0)
      ks::fail(KS_ERROR_INVALID_STATE, "scene is read by %u submitted renders: wait for them before it is changed", renders);
  }
  kuafu::Scene* operator->() const { return &owner->scene; }
  ks::Exclusive<kuafu_scene_t> owner;
};

template <class T>
T& required(T* pointer, const char* name) {
  if (pointer == nullptr) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s is NULL", name);
  return *pointer;
}

/// Callers count ids from 1, and 0 is none; the scene counts from 0, and none is 0xffffffff.
uint32_t index_of(uint32_t id) { return id - 1; }
uint32_t id_of(uint32_t index) { return index + 1; }

std::vector<uint32_t> indices_of(const uint32_t* ids, uint32_t count) {
  std::vector<uint32_t> out(ids, ids + count);
  std::ranges::transform(out, out.begin(), index_of);
  return out;
}

template <class T>
const T& at(const std::vector<T>& table, const char* kind, uint32_t id) {
  if (id >= table.size()) ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no %s %u (the scene has %zu)", kind, id, table.size());
  return table[id];
}

kuafu_scene_summary summarise(const kuafu::Scene& scene) {
  kuafu_scene_summary s = kuafu_scene_summary_init();
  s.mesh_count = uint32_t(scene.meshes().size());
  s.texture_count = uint32_t(scene.textures().size());
  s.material_count = uint32_t(scene.materials().size());
  s.instance_count = uint32_t(scene.instances().size());
  s.light_count = uint32_t(scene.lights().size());
  s.camera_count = static_cast<uint32_t>(scene.cameras().size());
  for (const auto& instance : scene.instances())
    if (instance) s.triangle_count += scene.meshes()[instance->mesh].indices.size();
  for (const auto& rig : scene.rigs()) s.animation_count += static_cast<uint32_t>(rig->animations.size());
  const kuafu::Bounds bounds = scene.bounds();
  for (int i = 0; i < 3; ++i) {
    s.bounds_min_m[i] = bounds.min[i];
    s.bounds_max_m[i] = bounds.max[i];
  }
  return s;
}

const kuafu::RigAnimation& animation_of(const kuafu::Scene& scene, uint32_t id) {
  size_t first = 0;
  for (const auto& rig : scene.rigs()) {
    if (id - first < rig->animations.size()) return rig->animations[id - first];
    first += rig->animations.size();
  }
  ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no animation %u (the scene has %zu)", id, first);
}

kuafu::Material to_material(const kuafu_material_desc* desc) {
  return kuafu::copied<kuafu::Material>(ks::read_struct(desc, KUAFU_TYPE_MATERIAL_DESC, "material desc"));
}

kuafu::Light to_light(const kuafu_light_desc* desc) { return kuafu::to_light(ks::read_struct(desc, KUAFU_TYPE_LIGHT_DESC, "light desc")); }

}  // namespace

std::shared_ptr<const void> kuafu::hold_unchanged(std::shared_ptr<DeviceScene> scene) {
  ++scene->submitted_renders;
  DeviceScene* const held = scene.get();
  return {held, [scene = std::move(scene)](const void*) { --scene->submitted_renders; }};
}

extern "C" {

ks_status kuafu_scene_create(kuafu_device device, kuafu_scene* out) {
  return ks::call([&] {
    ks::clear_out(out);
    *out = new kuafu_scene_t(std::make_shared<kuafu::DeviceScene>(ks::object_of(device, "device")));
  });
}

void kuafu_scene_retain(kuafu_scene scene) { ks::retain(scene, "scene"); }

void kuafu_scene_release(kuafu_scene scene) { ks::release(scene, "scene"); }

ks_status kuafu_scene_load(kuafu_scene scene, const char* path, const char* name, const double* root_to_world) {
  return ks::call([&] {
    const Changeable changed(scene);
    kuafu::DeviceScene& owner = *changed.owner;
    const ks::Interrupt interrupt([&owner, before = owner.load_wishes.load()](float) { return owner.load_wishes != before; });
    const glm::dmat4 root = root_to_world == nullptr ? glm::dmat4(1.0) : kuafu::from_row_major<4>(root_to_world);
    const kuafu::LoadOptions options = kuafu::load_options_from_environment();
    for (const std::string& warning : kuafu::load_file(owner.scene, &required(path, "path"), root, options, name == nullptr ? "" : name))
      owner.device->log(KS_LOG_WARNING, "%s", warning.c_str());
  });
}

ks_status kuafu_scene_cancel_load(kuafu_scene scene) {
  return ks::call([&] { ++ks::object_of(scene, "scene")->load_wishes; });
}

ks_status kuafu_scene_animate(kuafu_scene scene, uint32_t animation, double time_s) {
  return ks::call([&] { Changeable(scene)->animate(animation, time_s); });
}

ks_status kuafu_scene_animation_duration(kuafu_scene scene, uint32_t animation, double* out) {
  return ks::call([&] { required(out, "out") = animation_of(scene_of(scene), animation).duration_s(); });
}

const char* kuafu_scene_animation_name(kuafu_scene scene, uint32_t animation) {
  const char* name = nullptr;
  (void)ks::call([&] { name = animation_of(scene_of(scene), animation).name.c_str(); });
  return name;
}

ks_status kuafu_scene_get_summary(kuafu_scene scene, kuafu_scene_summary* out) {
  return ks::call([&] { ks::write_struct(out, summarise(scene_of(scene)), KUAFU_TYPE_SCENE_SUMMARY, "out"); });
}

ks_status kuafu_scene_add_mesh(kuafu_scene scene, const kuafu_mesh_desc* desc, uint32_t* id) {
  return ks::call([&] {
    required(id, "id") = 0;
    *id = id_of(Changeable(scene)->add_mesh(kuafu::to_mesh(ks::read_struct(desc, KUAFU_TYPE_MESH_DESC, "mesh desc"))));
  });
}

ks_status kuafu_scene_get_mesh(kuafu_scene scene, uint32_t id, kuafu_mesh_desc* out) {
  return ks::call([&] {
    ks::write_struct(out, kuafu::to_desc(kuafu::there(scene_of(scene).meshes(), "mesh", index_of(id))), KUAFU_TYPE_MESH_DESC, "out");
  });
}

ks_status kuafu_scene_update_mesh(kuafu_scene scene, uint32_t id, const float* positions, const float* normals, uint32_t vertex_count) {
  return ks::call([&] {
    Changeable(scene)->update_mesh_positions(index_of(id), kuafu::to_vectors(&required(positions, "positions"), vertex_count),
                                             kuafu::to_vectors(normals, vertex_count));
  });
}

ks_status kuafu_scene_add_texture(kuafu_scene scene, const kuafu_texture_desc* desc, uint32_t* id) {
  return ks::call([&] {
    required(id, "id") = 0;
    *id = id_of(Changeable(scene)->add_texture(kuafu::to_texture(ks::read_struct(desc, KUAFU_TYPE_TEXTURE_DESC, "texture desc"))));
  });
}

ks_status kuafu_scene_get_texture(kuafu_scene scene, uint32_t id, kuafu_texture_desc* out) {
  return ks::call([&] {
    ks::write_struct(out, kuafu::to_desc(kuafu::there(scene_of(scene).textures(), "texture", index_of(id))), KUAFU_TYPE_TEXTURE_DESC,
                     "out");
  });
}

ks_status kuafu_scene_set_texture(kuafu_scene scene, uint32_t id, const kuafu_texture_desc* desc) {
  return ks::call([&] {
    Changeable(scene)->set_texture(index_of(id), kuafu::to_texture(ks::read_struct(desc, KUAFU_TYPE_TEXTURE_DESC, "texture desc")));
  });
}

ks_status kuafu_scene_add_material(kuafu_scene scene, const kuafu_material_desc* desc, uint32_t* id) {
  return ks::call([&] {
    required(id, "id") = 0;
    *id = id_of(Changeable(scene)->add_material(to_material(desc)));
  });
}

ks_status kuafu_scene_set_material(kuafu_scene scene, uint32_t id, const kuafu_material_desc* desc) {
  return ks::call([&] { Changeable(scene)->set_material(index_of(id), to_material(desc)); });
}

ks_status kuafu_scene_get_material(kuafu_scene scene, uint32_t id, kuafu_material_desc* out) {
  return ks::call([&] {
    ks::write_struct(out, kuafu::to_desc(kuafu::there(scene_of(scene).materials(), "material", index_of(id))), KUAFU_TYPE_MATERIAL_DESC,
                     "out");
  });
}

ks_status kuafu_scene_add_instance(kuafu_scene scene, const kuafu_instance_desc* desc, uint32_t* id) {
  return ks::call([&] {
    required(id, "id") = 0;
    *id = id_of(Changeable(scene)->add_instance(kuafu::to_instance(ks::read_struct(desc, KUAFU_TYPE_INSTANCE_DESC, "instance desc"))));
  });
}

ks_status kuafu_scene_get_instance(kuafu_scene scene, uint32_t id, kuafu_instance_desc* out) {
  return ks::call([&] {
    kuafu::DeviceScene& owner = *ks::object_of(scene, "scene");
    const kuafu::Instance& instance = kuafu::there(owner.scene.instances(), "instance", index_of(id));
    kuafu_instance_desc desc = kuafu::to_desc(instance);
    owner.told_materials.resize(instance.materials.size());
    std::ranges::transform(instance.materials, owner.told_materials.begin(), id_of);
    desc.materials = owner.told_materials.data();
    desc.material_count = uint32_t(owner.told_materials.size());
    ks::write_struct(out, desc, KUAFU_TYPE_INSTANCE_DESC, "out");
  });
}

ks_status kuafu_scene_set_instance_pose(kuafu_scene scene, uint32_t id, const double* local_to_world) {
  return ks::call(
      [&] { Changeable(scene)->set_instance_pose(index_of(id), kuafu::from_row_major<4>(&required(local_to_world, "local_to_world"))); });
}

ks_status kuafu_scene_set_instance_poses(kuafu_scene scene, const uint32_t* ids, const double* local_to_world, uint32_t count) {
  return ks::call([&] {
    const Changeable changed(scene);
    if (count == 0) return;
    (void)required(ids, "ids"), (void)required(local_to_world, "local_to_world");
    std::vector<glm::dmat4> poses(count);
    for (uint32_t i = 0; i < count; ++i) poses[i] = kuafu::from_row_major<4>(local_to_world + size_t{16} * i);
    changed->set_instance_poses(indices_of(ids, count), poses);
  });
}

ks_status kuafu_scene_set_instance_velocity(kuafu_scene scene, uint32_t id, const double* linear, const double* angular) {
  return ks::call([&] {
    Changeable(scene)->set_instance_velocity(index_of(id), kuafu::to_twist(&required(linear, "linear"), &required(angular, "angular")));
  });
}

ks_status kuafu_scene_set_instance_materials(kuafu_scene scene, uint32_t id, const uint32_t* materials, uint32_t material_count) {
  return ks::call([&] {
    if (material_count > 0) (void)required(materials, "materials");
    Changeable(scene)->set_instance_materials(index_of(id), indices_of(materials, material_count));
  });
}

ks_status kuafu_scene_next_frame(kuafu_scene scene) {
  return ks::call([&] { Changeable(scene)->next_frame(); });
}

ks_status kuafu_scene_remove_mesh(kuafu_scene scene, uint32_t id) {
  return ks::call([&] { Changeable(scene)->remove_mesh(index_of(id)); });
}

ks_status kuafu_scene_remove_texture(kuafu_scene scene, uint32_t id) {
  return ks::call([&] { Changeable(scene)->remove_texture(index_of(id)); });
}

ks_status kuafu_scene_remove_material(kuafu_scene scene, uint32_t id) {
  return ks::call([&] { Changeable(scene)->remove_material(index_of(id)); });
}

ks_status kuafu_scene_remove_instance(kuafu_scene scene, uint32_t id) {
  return ks::call([&] { Changeable(scene)->remove_instance(index_of(id)); });
}

const char* kuafu_scene_instance_name(kuafu_scene scene, uint32_t id) {
  const char* name = nullptr;
  (void)ks::call([&] { name = kuafu::there(scene_of(scene).instances(), "instance", index_of(id)).name.c_str(); });
  return name;
}

const char* kuafu_scene_material_name(kuafu_scene scene, uint32_t id) {
  const char* name = nullptr;
  (void)ks::call([&] { name = kuafu::there(scene_of(scene).materials(), "material", index_of(id)).name.c_str(); });
  return name;
}

ks_status kuafu_scene_add_light(kuafu_scene scene, const kuafu_light_desc* desc, uint32_t* id) {
  return ks::call([&] {
    required(id, "id") = 0;
    *id = id_of(Changeable(scene)->add_light(to_light(desc)));
  });
}

ks_status kuafu_scene_set_light(kuafu_scene scene, uint32_t id, const kuafu_light_desc* desc) {
  return ks::call([&] { Changeable(scene)->set_light(index_of(id), to_light(desc)); });
}

ks_status kuafu_scene_set_lights(kuafu_scene scene, const uint32_t* ids, const kuafu_light_desc* descs, uint32_t count) {
  return ks::call([&] {
    const Changeable changed(scene);
    if (count == 0) return;
    (void)required(ids, "ids");
    std::vector<kuafu::Light> lights(count);
    for (uint32_t i = 0; i < count; ++i)
      lights[i] = kuafu::to_light(ks::read_element(&required(descs, "descs"), i, KUAFU_TYPE_LIGHT_DESC, "light desc"));
    changed->set_lights(indices_of(ids, count), lights);
  });
}

ks_status kuafu_scene_get_light(kuafu_scene scene, uint32_t id, kuafu_light_desc* out) {
  return ks::call([&] {
    ks::write_struct(out, kuafu::to_desc(kuafu::there(scene_of(scene).lights(), "light", index_of(id))), KUAFU_TYPE_LIGHT_DESC, "out");
  });
}

ks_status kuafu_scene_remove_light(kuafu_scene scene, uint32_t id) {
  return ks::call([&] { Changeable(scene)->remove_light(index_of(id)); });
}

ks_status kuafu_scene_set_environment(kuafu_scene scene, const kuafu_environment_desc* desc) {
  return ks::call([&] {
    Changeable(scene)->set_environment(
        kuafu::copied<kuafu::Environment>(ks::read_struct(desc, KUAFU_TYPE_ENVIRONMENT_DESC, "environment desc")));
  });
}

ks_status kuafu_scene_set_medium(kuafu_scene scene, const kuafu_medium_desc* desc) {
  return ks::call([&] {
    if (desc == nullptr) return Changeable(scene)->set_medium(std::nullopt);
    Changeable(scene)->set_medium(kuafu::copied<kuafu::Medium>(ks::read_struct(desc, KUAFU_TYPE_MEDIUM_DESC, "medium desc")));
  });
}

ks_status kuafu_scene_get_camera(kuafu_scene scene, uint32_t index, kuafu_camera_desc* out) {
  return ks::call(
      [&] { ks::write_struct(out, kuafu::to_desc(at(scene_of(scene).cameras(), "camera", index)), KUAFU_TYPE_CAMERA_DESC, "out"); });
}

}  // extern "C"
