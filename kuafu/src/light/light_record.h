// One light of the scene as shaders read it. Thread rule: pure functions.
#pragma once

#include "light/light_table.h"

namespace kuafu {

struct LightEntry {
  LightRecord record{};
  LightShape shape{};
  LightMotion motion{};
  double power = 0;     // W up to a common factor; errs to the bright side
  bool shaped = false;  // the shape says more than the record
  bool met = false;     // rays meet it
};

/// world_radius_m: half the diagonal of what there is, for the power of lights that come from infinitely far.
LightEntry light_entry(const Light& light, const glm::vec3& intensity, const Scene& scene, double world_radius_m,
                       const std::function<PatternAddress(const Light&)>& pattern);

/// Largest channel: what chances go by.
double brightness(const glm::vec3& value);

}  // namespace kuafu
