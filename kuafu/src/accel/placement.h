// SPDX-License-Identifier: Apache-2.0
// The placements of meshes, one per slot of the scene's instances (Scene::instance_slots), which a hit names; and the environments that see
// them. Thread rule: pure functions.
#pragma once

#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// An instance's motion while the shutters are open.
struct Sweep {
  Motion motion;
  TimeSpan span;
  bool operator==(const Sweep&) const = default;
};

struct Placement {
  uint32_t mesh = none;
  uint32_t environment = none;  // none = every environment
  glm::dmat4 local_to_world{1.0}, world_to_local{1.0};
  /// false: nothing to hit, because the slot is empty, the mesh has no triangles or the transform flattens it to nothing (no inverse).
  bool traceable = false;
  std::optional<Sweep> sweep;  // empty: it stands still
  bool operator==(const Placement&) const = default;
  [[nodiscard]] bool seen_by(uint32_t e) const { return traceable && (environment == none || environment == e); }
};

/// The times that rays may have: the open time of the shutters, or an instant if no instance moves.
TimeSpan ray_times(const Scene& scene, const TimeSpan& open);

Placement placement_in(const Scene& scene, uint32_t slot, const TimeSpan& times);
std::vector<Placement> all_placements(const Scene& scene, const TimeSpan& times);

/// For each environment, the ascending slots of the placements that it sees. Instances of environments beyond the count belong to none.
std::vector<std::vector<uint32_t>> placements_by_environment(const std::vector<Placement>& placements, uint32_t environment_count);

/// Returns the ascending slots that may have changed since this revision of the instances, or whose mesh deformed. Nothing if they are too
/// many to follow one by one.
std::optional<std::vector<uint32_t>> changed_slots(const Scene& scene, uint64_t revision, const std::vector<uint32_t>& deformed,
                                                   const std::vector<Placement>& placements);

}  // namespace kuafu
