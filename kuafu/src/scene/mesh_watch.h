// SPDX-License-Identifier: Apache-2.0
// Which meshes of a scene are new, deformed or gone since a reader last looked. Thread rule: externally synchronised.
#pragma once

#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Trees whose quality is not ours to measure are built anew after so many refits in place.
inline constexpr uint32_t most_refits = 32;

class MeshWatch {
 public:
  struct Changes {
    uint32_t first_new = 0;          // ids from here on are new; some of them may be removed already, and empty
    std::vector<uint32_t> deformed;  // below first_new, ascending
    std::vector<uint32_t> removed;   // the same
  };

  Changes look(const Scene& scene) {
    Changes changes{uint32_t(seen_.size()), {}, {}};
    if (scene.revisions().meshes == revision_) return changes;
    revision_ = scene.revisions().meshes;
    for (uint32_t id = 0; id < seen_.size(); ++id) {
      const Mesh& mesh = scene.meshes()[id];
      if (mesh.removed != seen_[id].removed)
        changes.removed.push_back(id);
      else if (mesh.deformation != seen_[id].deformation)
        changes.deformed.push_back(id);
    }
    seen_.clear();
    for (const Mesh& mesh : scene.meshes()) seen_.push_back({mesh.deformation, mesh.removed});
    return changes;
  }
  void forget() { seen_.clear(), revision_ = 0; }

 private:
  struct Seen {
    uint64_t deformation;
    bool removed;
  };
  std::vector<Seen> seen_;
  uint64_t revision_ = 0;
};

}  // namespace kuafu
