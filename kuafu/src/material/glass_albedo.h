// Directional albedos of one facet of rough glass: what it reflects and lets through, of all light; the rest meets several facets.
// Thread rule: pure functions.
#pragma once

#include <glm/glm.hpp>
#include <vector>

#include "device/thread_pool.h"

namespace kuafu {

/// [index][roughness], glass_albedo_indices and glass_albedo_roughnesses, of 2 (glass_albedo_cosines + 1) entries, from outside as x and
/// from inside as y: at the cosines, then the mean over the hemisphere; and the same once more for specular 0, where only total reflection
/// is left. Steps are equal in the roughness, in the root of the cosine, and in that of (ior - 1) / (ior + 1). Takes some 50 ms of work:
/// for scenes that have rough glass.
std::vector<glm::vec2> glass_albedo_table(ks::ThreadPool& workers);

}  // namespace kuafu
