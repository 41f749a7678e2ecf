// SPDX-License-Identifier: Apache-2.0
#include "tables/scene_tables.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "device/thread_pool.h"
#include "light/light_table.h"
#include "material/albedo_tables.h"
#include "material/material_record.h"
#include "scene/motion.h"

namespace kuafu {
SceneTables::SceneTables(Memory memory) : memory_(std::move(memory)), textures_(memory_) { write_albedos(false, false); }

void SceneTables::write_albedos(bool frosted, bool sheen) {
  const std::vector<glm::vec2> tables = albedo_tables(memory_.device->workers(), sheen, frosted);
  Block block;
  block.add(tables);
  specular_albedo_ = block.upload(memory_.device);
  has_glass_albedo_ = frosted;
  has_sheen_albedo_ = sheen;
}

void SceneTables::update(const Scene& scene, const Band& band, uint32_t environment_count, const TimeSpan& open) {
  if (std::exchange(scene_, nullptr) != scene.identity()) forget();  // and forget too what a failed update left
  const Revisions& now = scene.revisions();
  const bool patterns_changed = now.textures != seen_.textures && textures_.update(scene);
  const bool lights_changed = now.lights != seen_.lights || patterns_changed || now.materials != seen_.materials || !(band == band_) ||
                              environment_count != environment_count_ || moved_lights(scene) || (lights_move_ && !(open == open_));
  const bool materials_changed = now.materials != seen_.materials || !(band == band_);
  band_ = band;
  open_ = open;
  if (now.meshes != seen_.meshes) meshes_.update(memory_, scene);
  if (now.meshes != seen_.meshes || now.textures != seen_.textures) lookup_features_ = lookups_of(scene);
  if (materials_changed) write_materials(scene);
  if (now.instances != seen_.instances) instances_.update(memory_, scene, meshes_);
  if (has_bending_ && (materials_changed || now.instances != seen_.instances || now.meshes != seen_.meshes))
    glass_bodies_.update(scene, band);
  if (lights_changed) write_lights(scene, environment_count);
  write_medium(scene);
  if (now.instances != seen_.instances || lights_changed) write_instance_motions(scene);
  moves_ = !open.instant() && (scene.instances_move() || lights_move_);
  seen_ = now;
  environment_count_ = environment_count;
  tables_.resize(memory_, 1)[0] = {.instances = instances_.records(),
                                   .instance_materials = instances_.materials(),
                                   .materials = materials_.address(),
                                   .textures = textures_.address(),
                                   .lights = lights_.address(),
                                   .environments = environments_.address(),
                                   .specular_albedo = memory_.address(*specular_albedo_),
                                   .light_shapes = light_shapes_.address(),
                                   .light_cumulative = light_cumulative_.address(),
                                   .light_triangles = light_triangles_.address(),
                                   .medium = medium_.address(),
                                   .instance_motions = instance_motions_.address(),
                                   .light_motions = light_motions_.address(),
                                   .moves = moves_ ? 1u : 0u,
                                   .reserved = 0};
  scene_ = scene.identity();
}

uint32_t SceneTables::lookups_of(const Scene& scene) const {
  const auto looks_up = [](const auto& mesh) { return mesh && (!mesh->uvs_1.empty() || !mesh->colors.empty() || !mesh->tangents.empty()); };
  return textures_.looks_up() || std::ranges::any_of(scene.meshes(), looks_up) ? feature_lookups : 0;
}

/// Whether something that moved since the last update gives light, or changes the power of light from infinitely far. The band is the same.
bool SceneTables::moved_lights(const Scene& scene) {
  const Revisions& now = scene.revisions();
  if (now.instances == seen_.instances && now.meshes == seen_.meshes) return false;
  if (world_radius_m(scene) != world_radius_m_) return true;
  if (!emissive_) return false;
  const auto changes = scene.instance_changes(seen_.instances);
  if (now.meshes != seen_.meshes || !changes) return true;
  return std::ranges::any_of(*changes, [&](uint32_t slot) {
    const uint32_t id = scene.instance_slots()[slot];
    return (slot < shining_.size() && shining_[slot]) || (id != none && shines(scene, band_, scene.instances()[id]));
  });
}

void SceneTables::forget() {
  seen_ = {0, 0, 0, 0, 0};
  meshes_.forget();
  instances_.forget();
  textures_.forget();
  glass_bodies_.forget();
}

void SceneTables::write_materials(const Scene& scene) {
  const std::vector<uint32_t>& ids = scene.materials().ids();
  const auto records = materials_.resize(memory_, ids.size() + 1);
  has_glass_ = has_bending_ = emissive_ = false;
  bool frosted = false, sheen = false;
  material_features_ = emission_group_ = 0;
  for (const uint32_t id : ids) {
    if (id == none) continue;
    const Material& material = scene.materials()[id];
    const Material m = in_band(material, band_);
    records[material_index(scene, id)] = material_record(material, id, band_, scene.textures());
    has_glass_ = has_glass_ || is_glass(m);
    has_bending_ = has_bending_ || bends_light(m);
    emissive_ = emissive_ || m.emission != glm::vec3(0);
    frosted = frosted || is_frosted(m);
    sheen = sheen || has_sheen(m);
    material_features_ |= material_features(m);
    emission_group_ = std::max(emission_group_, m.light_group);
  }
  records[material_index(scene, none)] = material_record(grey_default(), none, band_, scene.textures());
  if ((frosted && !has_glass_albedo_) || (sheen && !has_sheen_albedo_))
    write_albedos(frosted || has_glass_albedo_, sheen || has_sheen_albedo_);
}

void SceneTables::write_medium(const Scene& scene) {
  MediumRecord& r = medium_.resize(memory_, 1)[0];
  r = {};
  has_medium_ = false;
  if (!scene.medium()) return;
  const Medium& m = *scene.medium();
  constexpr float endless = 3e38f;
  r.extinction = band_.color(m.extinction_per_m, m.ir_extinction_per_m);
  r.albedo = band_.color(m.albedo, m.ir_albedo);
  r.phase_g = m.phase_g;
  r.bounds_min = glm::vec3(glm::max(m.bounds_min_m, glm::dvec3(-double(endless))));
  r.bounds_max = glm::vec3(glm::min(m.bounds_max_m, glm::dvec3(double(endless))));
  r.housing_m = m.housing_m;
  has_medium_ = r.extinction != glm::vec3(0);
}

/// A light may move among instances that stand still, so the table is there if either moves.
void SceneTables::write_instance_motions(const Scene& scene) {
  if (!scene.instances_move() && !lights_move_) return;
  const auto motions = instance_motions_.resize(memory_, scene.instance_slots().size());
  for (size_t slot = 0; slot < motions.size(); ++slot) {
    const uint32_t id = scene.instance_slots()[slot];
    motions[slot] = id == none ? MotionRecord{} : motion_record(scene.instances()[id].local_to_world, scene.instances()[id].velocity);
  }
}

void SceneTables::write_lights(const Scene& scene, uint32_t environment_count) {
  const LightTable table = make_light_table(
      scene, band_, environment_count, [&](const Light& light) { return textures_.pattern(scene, light); }, open_);
  std::ranges::copy(table.motions, light_motions_.resize(memory_, table.motions.size()).begin());
  lights_move_ = std::ranges::any_of(scene.lights(), [](const auto& l) { return l && (l->velocity.moves() || l->has_window()); });
  textures_.drop_unused();
  world_radius_m_ = world_radius_m(scene);
  shining_.assign(emissive_ ? scene.instance_slots().size() : 0, false);
  for (size_t slot = 0; slot < shining_.size(); ++slot) {
    const uint32_t id = scene.instance_slots()[slot];
    shining_[slot] = id != none && shines(scene, band_, scene.instances()[id]);
  }
  std::ranges::copy(table.lights, lights_.resize(memory_, table.lights.size()).begin());
  std::ranges::copy(table.shapes, light_shapes_.resize(memory_, table.shapes.size()).begin());
  std::ranges::copy(table.cumulative, light_cumulative_.resize(memory_, table.cumulative.size()).begin());
  std::ranges::copy(table.triangles, light_triangles_.resize(memory_, table.triangles.size()).begin());
  sharp_lights_ = kuafu::sharp_lights(table);
  light_features_ = table.has_shapes ? feature_lights : 0;
  std::ranges::copy(table.environments, environments_.resize(memory_, table.environments.size()).begin());
  shadow_rays_per_vertex_ = table.shadow_rays_per_vertex;
  select_lights_ = table.select_lights;
  light_group_ = scene.environment().light_group;
  for (const LightRecord& light : table.lights) light_group_ = std::max(light_group_, light.light_group);
  has_environment_light_ = std::ranges::any_of(table.environments, [](const auto& e) { return e.radiance != glm::vec3(0); });
}

}  // namespace kuafu
