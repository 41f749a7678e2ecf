// SPDX-License-Identifier: Apache-2.0
// Parts of a file that would be invisible. Exporters mix up opacity and transparency (MTL's Tr, Collada's A_ONE and RGB_ZERO), and a whole
// body then has opacity 0. Thread rule: pure functions.
#pragma once

#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Makes materials opaque that are invisible everywhere, unless `keep`. Returns a message for each.
std::vector<std::string> show_transparent(Scene& scene, bool keep);

/// Returns a message for each mesh whose triangles are lines or points and never move.
std::vector<std::string> without_area(const Scene& scene);

}  // namespace kuafu
