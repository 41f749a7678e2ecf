// SPDX-License-Identifier: Apache-2.0
// Lights of the scene as shaders read them: single ones (light_record.cpp), and those that surfaces and the environment's map make
// (emitters.cpp). Thread rule: pure functions.
#pragma once

#include <optional>

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

/// Returns a light's table entry. world_radius_m: half the scene's diagonal, for the power of infinitely distant lights.
LightEntry light_entry(const Light& light, const glm::vec3& intensity, const Scene& scene, double world_radius_m,
                       const std::function<PatternAddress(const Light&)>& pattern);

/// The largest channel, by which lights are chosen.
double brightness(const glm::vec3& value);

/// Whether one of the instance's materials emits light in the band.
bool shines(const Scene& scene, const Band& band, const Instance& instance);

/// Returns the entry of all emissive surfaces that the environment sees, sampled by power; appends to the table's cumulative and triangles.
/// Nothing if no surface emits.
std::optional<LightEntry> mesh_light(const Scene& scene, const Band& band, uint32_t environment, LightTable& table);

/// Returns the entry of the environment's map, sampled by brightness; appends to the table's cumulative. Nothing if there is no map or it
/// is black.
std::optional<LightEntry> map_light(const Scene& scene, const Band& band, double world_radius_m, LightTable& table);

}  // namespace kuafu
