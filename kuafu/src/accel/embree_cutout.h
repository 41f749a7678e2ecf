// SPDX-License-Identifier: Apache-2.0
// Embree's side of surfaces that are not everywhere there (lib/cutout.glsl): meshes that show such a material get a filter, which asks the
// scene's tables. Thread rule: as Embree's traversal.
#pragma once

#include <embree3/rtcore.h>

#include <unordered_set>

#include "scene/scene.h"
#include "shared/scene_records.h"

namespace kuafu {

/// The cutout filter's data at the start of Embree's context.
struct EmbreeContext {
  RTCIntersectContext context{};
  const SceneAddresses* scene = nullptr;  // null: everything is there
  const uint32_t* instances = nullptr;    // Embree's instID -> slot
  uint32_t kind = cutout_closest;
};

/// Returns the ids of meshes that any instance shows with a cutout material.
std::unordered_set<uint32_t> meshes_with_cutouts(const Scene& scene);

/// Sets the filter; call before the geometry is committed.
void set_cutout_filter(RTCGeometry geometry);

}  // namespace kuafu
