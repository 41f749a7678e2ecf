// SPDX-License-Identifier: Apache-2.0
// A projector's pattern as pixels see it: means over a pixel's square and a beam's disc, for discs of several sizes
// (lib/pattern_mean.glsl). Thread rule: pure functions.
#pragma once

#include <vector>

#include "device/thread_pool.h"
#include "scene/scene.h"

namespace kuafu {

struct PatternStack {
  std::vector<float> means;  // [level][height][width], with a border of one mean around the pattern
  uint32_t width = 0, height = 0, levels = 0;
  float step_px = 1.0f;
};

/// pixel_px: a camera's pixel on the pattern, in pixels of that, along u and v. most_diameter_px: of a disc.
PatternStack pattern_stack(const Texture& pattern, glm::dvec2 pixel_px, double most_diameter_px, ks::ThreadPool& workers);

}  // namespace kuafu
