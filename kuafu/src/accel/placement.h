// Where the meshes stand: the scene's live instances in id order, which is the order of hit_instance, and who sees them.
// Thread rule: pure functions.
#pragma once

#include <vector>

#include "scene/scene.h"

namespace kuafu {

struct Placement {
  uint32_t mesh = none;
  uint32_t environment = none;  // none = every environment
  glm::dmat4 local_to_world{1.0}, world_to_local{1.0};
  /// false: nothing to hit, because the mesh has no triangles or the transform flattens it to nothing (no inverse).
  bool traceable = false;
  bool operator==(const Placement&) const = default;
};

std::vector<Placement> live_placements(const Scene& scene);

/// For each environment, the traceable placements it sees, ascending. Instances of environments beyond the count are seen by none.
std::vector<std::vector<uint32_t>> placements_by_environment(const std::vector<Placement>& placements, uint32_t environment_count);

}  // namespace kuafu
