// SPDX-License-Identifier: Apache-2.0
#include "tables/scene_tables.h"

#include <algorithm>

#include "device/error.h"
#include "light/light_table.h"

namespace kuafu {
namespace {

bool is_projector(const Light& light) { return light.kind == Light::Kind::projector && (light.texture != none || light.raster); }

/// The projector that views into `environment` ask about, lit or dark; null if there is none.
const Light* projector_of(const Scene& scene, uint32_t wanted, uint32_t environment) {
  for (const uint32_t id : scene.lights().ids()) {
    if (id == none || (wanted != none && wanted != id)) continue;
    const Light& light = scene.lights()[id];
    if (is_projector(light) && (light.environment == none || light.environment == environment)) return &light;
  }
  return nullptr;
}

}  // namespace

void AovTables::update(const Scene& scene, const Launch& launch) {
  if (launch.wants_projector()) write_projectors(scene, launch);
  if (launch.wants_motion()) write_motion(scene, launch);
  addresses_.resize(memory_, 1)[0] = {
      .projectors = projectors_.address(), .motion = motion_.address(), .previous_local_to_world = previous_local_to_world_.address()};
}

void AovTables::write_projectors(const Scene& scene, const Launch& launch) {
  const uint32_t id = launch.projector;
  if (id != none && (!scene.lights().has(id) || !is_projector(scene.lights()[id])))
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "projector is %u, but the scene has no such projector: give a projector's light id or 0", id + 1);
  const auto records = projectors_.resize(memory_, launch.environment_count());
  for (uint32_t e = 0; e < records.size(); ++e) {
    records[e] = {};
    const Light* light = projector_of(scene, id, e);
    if (light == nullptr) continue;
    const LightEntry entry = light_entry(*light, glm::vec3(1.0f), scene, 0.0, [](const Light&) { return PatternAddress{}; });
    records[e] = {.light = entry.record, .shape = entry.shape, .found = 1, .reserved = 0};
  }
}

void AovTables::write_motion(const Scene& scene, const Launch& launch) {
  const auto views = motion_.resize(memory_, launch.views.size());
  std::ranges::transform(launch.views, views.begin(), motion_view);
  std::vector<glm::vec4> rows;
  for (const uint32_t id : scene.instance_slots()) {
    const glm::dmat4 pose = id == none ? glm::dmat4(1.0) : scene.instances()[id].previous_local_to_world;
    for (int i = 0; i < 3; ++i) rows.emplace_back(glm::transpose(pose)[i]);
  }
  std::ranges::copy(rows, previous_local_to_world_.resize(memory_, rows.size()).begin());
}

}  // namespace kuafu
