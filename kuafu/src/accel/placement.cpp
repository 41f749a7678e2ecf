#include "accel/placement.h"

#include <cmath>

namespace kuafu {
namespace {

bool all_finite(const glm::dmat4& m) {
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row)
      if (!std::isfinite(m[column][row])) return false;
  return true;
}

}  // namespace

std::vector<Placement> live_placements(const Scene& scene) {
  std::vector<Placement> placements;
  for (const auto& instance : scene.instances()) {
    if (!instance) continue;
    Placement p{instance->mesh, instance->environment, instance->local_to_world};
    const glm::dmat4 inverse = glm::inverse(p.local_to_world);
    p.traceable = all_finite(inverse) && !scene.meshes()[p.mesh].indices.empty();
    if (p.traceable) p.world_to_local = inverse;
    placements.push_back(p);
  }
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

}  // namespace kuafu
