// SPDX-License-Identifier: Apache-2.0
// Which meshes of a scene are new, deformed or gone since a reader last looked. Thread rule: externally synchronised.
#pragma once

#include <algorithm>
#include <unordered_map>
#include <utility>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Trees whose quality is not ours to measure are rebuilt after so many refits in place.
inline constexpr uint32_t most_refits = 32;

class MeshWatch {
 public:
  struct Changes {
    std::vector<uint32_t> added, deformed, removed;  // ids, ascending
  };

  Changes look(const Scene& scene) {
    Changes changes;
    if (scene.revisions().meshes == revision_) return changes;
    revision_ = scene.revisions().meshes;
    for (const auto& [id, deformation] : seen_)
      if (!scene.meshes().has(id)) changes.removed.push_back(id);
    for (const uint32_t id : changes.removed) seen_.erase(id);
    for (const uint32_t id : scene.meshes().ids()) {
      if (id == none) continue;
      const uint64_t now = scene.meshes()[id].deformation;
      const auto [seen, is_new] = seen_.try_emplace(id, now);
      if (is_new)
        changes.added.push_back(id);
      else if (std::exchange(seen->second, now) != now)
        changes.deformed.push_back(id);
    }
    for (auto* ids : {&changes.added, &changes.deformed, &changes.removed}) std::ranges::sort(*ids);
    return changes;
  }
  void forget() { seen_.clear(), revision_ = 0; }

 private:
  std::unordered_map<uint32_t, uint64_t> seen_;  // id -> Mesh::deformation
  uint64_t revision_ = 0;
};

}  // namespace kuafu
