// SPDX-License-Identifier: Apache-2.0
// The scene in the stages' memory. `update` uploads what changed since the last update (Scene::revisions).
// Thread rule: externally synchronised; no work may be in flight during update.
#pragma once

#include <memory>

#include "frame/band.h"
#include "frame/device_array.h"
#include "frame/launch.h"
#include "light/light_table.h"
#include "scene/scene.h"
#include "shared/scene_records.h"
#include "shared/wave.h"
#include "tables/beam_sources.h"
#include "tables/instance_table.h"
#include "tables/texture_tables.h"

namespace kuafu {

class SceneTables {
 public:
  explicit SceneTables(Memory memory);

  void update(const Scene& scene, const Band& band, uint32_t environment_count, const TimeSpan& open);

  [[nodiscard]] uint64_t address() const { return tables_.address(); }
  /// Shadow rays of each vertex. In a medium, half of them belong to scattering.
  [[nodiscard]] uint32_t shadow_rays_per_vertex() const { return shadow_rays_per_vertex_ * (has_medium_ ? 2 : 1); }
  /// Passes that a wave may need beyond its bounces.
  [[nodiscard]] uint32_t walk_passes() const { return (material_features_ & feature_subsurface) != 0 ? walk_limit : 0; }
  [[nodiscard]] bool has_medium() const { return has_medium_; }
  /// The feature_* flags that the scene needs.
  [[nodiscard]] uint32_t features() const {
    return lookup_features_ | light_features_ | material_features_ | (has_medium_ ? feature_medium : 0) | (moves_ ? feature_motion : 0);
  }
  /// Whether anything but a camera moves, or a light switches, while a shutter is open.
  [[nodiscard]] bool moves() const { return moves_; }
  [[nodiscard]] bool select_lights() const { return select_lights_; }
  /// One past the last light group that the scene uses.
  [[nodiscard]] uint32_t light_groups() const { return 1 + std::max(emission_group_, light_group_); }
  /// Whether any surface lets light through.
  [[nodiscard]] bool has_glass() const { return has_glass_; }
  /// Whether some glass is smooth and bounds a body, so that it bends light.
  [[nodiscard]] bool has_bending() const { return has_bending_; }
  /// The bodies of glass; valid if has_bending().
  [[nodiscard]] const std::vector<GlassBody>& glass_bodies() const { return glass_bodies_.bodies(); }
  [[nodiscard]] const std::vector<SharpLight>& sharp_lights() const { return sharp_lights_; }
  [[nodiscard]] double radius_m() const { return world_radius_m_; }  // half the diagonal of what there is, where some light is directional
  /// Whether the environment or a surface emits light in the band, which only BSDF rays find.
  [[nodiscard]] bool has_ambient() const { return has_environment_light_ || (light_features_ & feature_lights) != 0 || emissive_; }

 private:
  void forget();
  /// Writes the tables of albedos; `frosted` adds rough glass, `sheen` fills in fibres.
  void write_albedos(bool frosted, bool sheen);
  [[nodiscard]] uint32_t lookups_of(const Scene& scene) const;
  bool moved_lights(const Scene& scene);
  void write_materials(const Scene& scene);
  void write_medium(const Scene& scene);
  void write_instance_motions(const Scene& scene);
  void write_lights(const Scene& scene, uint32_t environment_count);

  Memory memory_;
  std::shared_ptr<ks::Buffer> specular_albedo_;
  bool has_glass_albedo_ = false, has_sheen_albedo_ = false;
  std::shared_ptr<const void> scene_;  // its identity; null: none, or the last update failed
  Revisions seen_{0, 0, 0, 0, 0};
  Band band_;
  uint32_t environment_count_ = 0;

  MeshTable meshes_;
  InstanceTable instances_;
  GlassBodies glass_bodies_;
  std::vector<SharpLight> sharp_lights_;
  TextureTables textures_;
  MappedTable<MaterialRecord> materials_;
  MappedTable<LightRecord> lights_;
  MappedTable<EnvironmentRecord> environments_;
  MappedTable<LightShape> light_shapes_;
  MappedTable<float> light_cumulative_;
  MappedTable<uint32_t> light_triangles_;
  MappedTable<MediumRecord> medium_;
  MappedTable<MotionRecord> instance_motions_;
  MappedTable<LightMotion> light_motions_;
  MappedTable<SceneAddresses> tables_;
  TimeSpan open_;
  bool moves_ = false, lights_move_ = false;
  uint32_t shadow_rays_per_vertex_ = 0;
  bool select_lights_ = false, has_environment_light_ = false, has_glass_ = false, has_bending_ = false, has_medium_ = false;
  uint32_t lookup_features_ = 0;  // of textures and meshes
  uint32_t light_features_ = 0, material_features_ = 0;
  uint32_t light_group_ = 0, emission_group_ = 0;  // highest
  bool emissive_ = false;                          // some material shines in the band
  double world_radius_m_ = 0.0;                    // that the lights were written with
  std::vector<bool> shining_;                      // by slot of the instances: whether it was among the lights
};

/// Stage `aov` reads these tables beyond the scene's: the projectors, and the motion since the last frame. Each render that asks for them
/// makes them again.
class AovTables {
 public:
  explicit AovTables(Memory memory) : memory_(std::move(memory)) {}

  /// Updates the tables; throws if the launch names a light that is no projector.
  void update(const Scene& scene, const Launch& launch);
  [[nodiscard]] uint64_t address() const { return addresses_.address(); }

 private:
  void write_projectors(const Scene& scene, const Launch& launch);
  void write_motion(const Scene& scene, const Launch& launch);

  Memory memory_;
  MappedTable<ProjectorRecord> projectors_;
  MappedTable<MotionView> motion_;
  MappedTable<glm::vec4> previous_local_to_world_;
  MappedTable<AovAddresses> addresses_;
};

}  // namespace kuafu
