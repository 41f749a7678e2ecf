// SPDX-License-Identifier: Apache-2.0
#include "tables/glass_boxes.h"

#include <algorithm>

#include "material/material_record.h"

namespace kuafu {
namespace {

constexpr size_t most_boxes = 32;  // each vertex looks at all of them: more become one
constexpr float endless = 3e38f;

bool passes_light(const Scene& scene, const Instance& instance, const Band& band) {
  return std::ranges::any_of(instance.materials,
                             [&](uint32_t id) { return id != none && is_smooth_glass(in_band(scene.materials()[id], band)); });
}

GlassBox world_box(const Scene::Bounds& local, const glm::dmat4& local_to_world) {
  GlassBox box{glm::vec3(endless), glm::vec3(-endless)};
  for (int corner = 0; corner < 8; ++corner) {
    const glm::dvec4 p(corner & 1 ? local.max.x : local.min.x, corner & 2 ? local.max.y : local.min.y,
                       corner & 4 ? local.max.z : local.min.z, 1.0);
    const glm::vec3 world(local_to_world * p);
    box.min = glm::min(box.min, world);
    box.max = glm::max(box.max, world);
  }
  const glm::vec3 rounding = 1e-5f * glm::max(glm::abs(box.min), glm::abs(box.max)) + 1e-6f;
  return {box.min - rounding, box.max + rounding};
}

}  // namespace

const Scene::Bounds& GlassBoxes::local_box(const Scene& scene, uint32_t mesh) {
  const Mesh& m = scene.meshes()[mesh];
  const auto [found, is_new] = meshes_.try_emplace(mesh);
  MeshBox& box = found->second;
  if (!is_new && box.deformation == m.deformation) return box.local;
  box = {m.deformation, {}};
  for (const glm::vec3& p : m.positions) {
    box.local.min = glm::min(box.local.min, glm::dvec3(p));
    box.local.max = glm::max(box.local.max, glm::dvec3(p));
  }
  return box.local;
}

void GlassBoxes::update(const Memory& memory, const Scene& scene, const Band& band) {
  std::vector<GlassBox> boxes;
  for (const auto& instance : scene.instances()) {
    if (!instance || !passes_light(scene, *instance, band) || scene.meshes()[instance->mesh].positions.empty()) continue;
    const bool moves = instance->velocity.moves();
    boxes.push_back(moves ? GlassBox{glm::vec3(-endless), glm::vec3(endless)}
                          : world_box(local_box(scene, instance->mesh), instance->local_to_world));
  }
  if (boxes.size() > most_boxes) {
    GlassBox all = boxes.front();
    for (const GlassBox& box : boxes) all = {glm::min(all.min, box.min), glm::max(all.max, box.max)};
    boxes = {all};
  }
  count_ = uint32_t(boxes.size());
  std::ranges::copy(boxes, table_.resize(memory, boxes.size()).begin());
}

}  // namespace kuafu
