// SPDX-License-Identifier: Apache-2.0
#include "accel/placement.h"

#include <algorithm>

#include "scene/finite.h"

namespace kuafu {

TimeSpan ray_times(const Scene& scene, const TimeSpan& open) { return scene.instances_move() ? open : TimeSpan{}; }

Placement placement_in(const Scene& scene, uint32_t slot, const TimeSpan& times) {
  const uint32_t id = scene.instance_slots()[slot];
  if (id == none) return {};
  const Instance& instance = scene.instances()[id];
  Placement p{instance.mesh, instance.environment, instance.local_to_world};
  const glm::dmat4 inverse = glm::inverse(p.local_to_world);
  p.traceable = all_finite(inverse) && !scene.meshes()[p.mesh].indices.empty();
  if (p.traceable) p.world_to_local = inverse;
  if (p.traceable && !times.instant() && instance.velocity.moves()) p.sweep = {world_motion(p.local_to_world, instance.velocity), times};
  return p;
}

std::vector<Placement> all_placements(const Scene& scene, const TimeSpan& times) {
  std::vector<Placement> placements(scene.instance_slots().size());
  for (uint32_t slot = 0; slot < placements.size(); ++slot) placements[slot] = placement_in(scene, slot, times);
  return placements;
}

std::vector<std::vector<uint32_t>> placements_by_environment(const std::vector<Placement>& placements, uint32_t environment_count) {
  std::vector<std::vector<uint32_t>> seen(environment_count);
  for (uint32_t i = 0; i < placements.size(); ++i) {
    if (!placements[i].traceable) continue;
    if (placements[i].environment == none)
      for (auto& list : seen) list.push_back(i);
    else if (placements[i].environment < environment_count)
      seen[placements[i].environment].push_back(i);
  }
  return seen;
}

std::optional<std::vector<uint32_t>> changed_slots(const Scene& scene, uint64_t revision, const std::vector<uint32_t>& deformed,
                                                   const std::vector<Placement>& placements) {
  const auto changes = scene.instance_changes(revision);
  const size_t most = scene.instance_slots().size() / 4 + 16;  // beyond, rebuilding is as quick
  if (!changes || changes->size() > most) return std::nullopt;
  std::vector<uint32_t> slots(changes->begin(), changes->end());
  for (uint32_t slot = 0; !deformed.empty() && slot < placements.size(); ++slot)
    if (std::ranges::binary_search(deformed, placements[slot].mesh)) slots.push_back(slot);
  std::ranges::sort(slots);
  slots.erase(std::unique(slots.begin(), slots.end()), slots.end());
  if (slots.size() > most) return std::nullopt;
  return slots;
}

}  // namespace kuafu
