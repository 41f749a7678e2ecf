// SPDX-License-Identifier: Apache-2.0
#include "tables/glass_bodies.h"

#include <algorithm>

#include "material/material_record.h"
#include "scene/box_corners.h"

namespace kuafu {
namespace {

bool bends(const Scene& scene, const Instance& instance, const Band& band) {
  return std::ranges::any_of(instance.materials,
                             [&](uint32_t id) { return id != none && bends_light(in_band(scene.materials()[id], band)); });
}

}  // namespace

void GlassBodies::update(const Scene& scene, const Band& band) {
  bodies_.clear();
  for (uint32_t slot = 0; slot < scene.instance_slots().size(); ++slot) {
    const uint32_t id = scene.instance_slots()[slot];
    if (id == none) continue;
    const Instance& instance = scene.instances()[id];
    const Mesh& mesh = scene.meshes()[instance.mesh];
    if (!bends(scene, instance, band) || mesh.positions.empty()) continue;
    GlassBody body{.min = glm::dvec3(1e300), .max = glm::dvec3(-1e300), .slot = slot, .environment = instance.environment};
    for (const glm::dvec3& corner : box_corners(mesh.bounds)) {
      const glm::dvec3 world(instance.local_to_world * glm::dvec4(corner, 1.0));
      body.min = glm::min(body.min, world);
      body.max = glm::max(body.max, world);
    }
    bodies_.push_back(body);
  }
}

}  // namespace kuafu
