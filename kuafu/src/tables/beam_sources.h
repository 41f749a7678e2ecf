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

/// About so many beams for each environment. world_radius_m: half the diagonal of what there is.
BeamSources make_beam_sources(const std::vector<SharpLight>& lights, const std::vector<GlassBody>& bodies, double world_radius_m,
                              uint32_t environment_count, uint32_t beams_per_environment);

}  // namespace kuafu
