// SPDX-License-Identifier: Apache-2.0
// These are the bodies of smooth glass, which bend light, with boxes around them in the world.
// Thread rule: externally synchronised.
#pragma once

#include <map>
#include <vector>

#include "frame/band.h"
#include "scene/scene.h"

namespace kuafu {

struct GlassBody {
  glm::dvec3 min, max;   // where it stands at mid-exposure
  uint32_t slot;         // of Scene::instance_slots
  uint32_t environment;  // none: every one
};

class GlassBodies {
 public:
  /// Cost follows the instances, and the vertices of glass that is new or deformed.
  void update(const Scene& scene, const Band& band);
  void forget() { meshes_.clear(), bodies_.clear(); }
  [[nodiscard]] const std::vector<GlassBody>& bodies() const { return bodies_; }

 private:
  struct MeshBox {
    uint64_t deformation = 0;
    Scene::Bounds local;
  };
  const Scene::Bounds& local_box(const Scene& scene, uint32_t mesh);

  std::map<uint32_t, MeshBox> meshes_;
  std::vector<GlassBody> bodies_;
};

}  // namespace kuafu
