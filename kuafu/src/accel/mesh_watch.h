// Which meshes of a scene are new, and which were deformed, since a tracer last looked. Thread rule: externally synchronised.
#pragma once

#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Trees whose quality is not ours to measure are built anew after so many refits in place.
inline constexpr uint32_t most_refits = 32;

class MeshWatch {
 public:
  struct Changes {
    uint32_t first_new = 0;          // ids from here on are new
    std::vector<uint32_t> deformed;  // below first_new, ascending
  };

  Changes look(const Scene& scene) {
    Changes changes{uint32_t(seen_.size()), {}};
    if (scene.revisions().meshes == revision_) return changes;
    revision_ = scene.revisions().meshes;
    for (uint32_t id = 0; id < seen_.size(); ++id)
      if (scene.meshes()[id].deformation != seen_[id]) changes.deformed.push_back(id);
    seen_.clear();
    for (const Mesh& mesh : scene.meshes()) seen_.push_back(mesh.deformation);
    return changes;
  }
  void forget() { seen_.clear(), revision_ = 0; }

 private:
  std::vector<uint64_t> seen_;
  uint64_t revision_ = 0;
};

}  // namespace kuafu
