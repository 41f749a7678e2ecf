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

/// Makes the means of a pattern over discs of several diameters. pixel_px: a camera pixel's size on the pattern along u and v, in the
/// pattern's pixels. most_diameter_px: the largest disc.
PatternStack pattern_stack(const Texture& pattern, glm::dvec2 pixel_px, double most_diameter_px, ks::ThreadPool& workers);

}  // namespace kuafu
