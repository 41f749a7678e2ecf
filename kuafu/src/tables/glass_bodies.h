// SPDX-License-Identifier: Apache-2.0
// These are the bodies of smooth glass, which bend light, with boxes around them in the world.
// Thread rule: externally synchronised.
#pragma once

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
  /// Finds the bodies of glass again. Its cost grows with the instances.
  void update(const Scene& scene, const Band& band);
  void forget() { bodies_.clear(); }
  [[nodiscard]] const std::vector<GlassBody>& bodies() const { return bodies_; }

 private:
  std::vector<GlassBody> bodies_;
};

}  // namespace kuafu
