// SPDX-License-Identifier: Apache-2.0
// What of a file nobody would see. Exporters mix up opacity and transparency (MTL's Tr, Collada's A_ONE and RGB_ZERO), and a whole body has
// opacity 0 then. Thread rule: pure functions.
#pragma once

#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Makes materials of which nothing would be seen anywhere opaque, unless they are to be kept; returns a message for each.
std::vector<std::string> show_transparent(Scene& scene, bool keep);

/// A message for each mesh whose triangles are lines or points and stay so.
std::vector<std::string> without_area(const Scene& scene);

}  // namespace kuafu
