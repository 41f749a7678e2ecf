// SPDX-License-Identifier: Apache-2.0
// Where beams of light begin (shared/beam_record.h): for each light without extent and each body of smooth glass, grids over the glass
// as the light sees it. Thread rule: pure functions.
#pragma once

#include <vector>

#include "light/light_table.h"
#include "shared/beam_record.h"
#include "tables/glass_bodies.h"

namespace kuafu {

struct BeamSources {
  std::vector<BeamSource> sources;
  uint32_t beam_count = 0;
};

/// Divides each environment's beams evenly among its pairs of a sharp light and a body of glass. world_radius_m: half the scene's diagonal.
BeamSources make_beam_sources(const std::vector<SharpLight>& lights, const std::vector<GlassBody>& bodies, double world_radius_m,
                              uint32_t environment_count, uint32_t beams_per_environment);

}  // namespace kuafu
