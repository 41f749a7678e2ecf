// SPDX-License-Identifier: Apache-2.0
// Where beams of light begin (shared/beam_record.h): for each light without extent and each body of smooth glass, grids over the glass
// as the light sees it. Thread rule: bodies are externally synchronised.
#pragma once

#include <vector>

#include "frame/band.h"
#include "light/light_table.h"
#include "scene/scene.h"
#include "shared/beam_record.h"

namespace kuafu {

struct GlassBody {
  glm::dvec3 min, max;   // where it stands at mid-exposure
  uint32_t slot;         // of Scene::instance_slots
  uint32_t environment;  // none: every one
};

/// The bodies of smooth glass, which bend light, with boxes around them in the world.
class GlassBodies {
 public:
  /// Finds the bodies of glass again. Its cost grows with the instances.
  void update(const Scene& scene, const Band& band);
  void forget() { bodies_.clear(); }
  [[nodiscard]] const std::vector<GlassBody>& bodies() const { return bodies_; }

 private:
  std::vector<GlassBody> bodies_;
};

struct BeamSources {
  std::vector<BeamSource> sources;
  uint32_t beam_count = 0;
};

/// Divides each environment's beams evenly among its pairs of a sharp light and a body of glass. world_radius_m: half the scene's diagonal.
BeamSources make_beam_sources(const std::vector<SharpLight>& lights, const std::vector<GlassBody>& bodies, double world_radius_m,
                              uint32_t environment_count, uint32_t beams_per_environment);

}  // namespace kuafu
