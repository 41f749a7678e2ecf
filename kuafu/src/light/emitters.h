// Lights that the scene's surfaces and its environment map make. Thread rule: pure functions.
#pragma once

#include <optional>

#include "light/light_record.h"

namespace kuafu {

/// Whether one of its materials gives light in the band.
bool shines(const Scene& scene, const Band& band, const Instance& instance);

/// All emissive surfaces that environment `environment` sees, sampled by power; appends to the table's cumulative and triangles. None:
/// nothing shines.
std::optional<LightEntry> mesh_light(const Scene& scene, const Band& band, uint32_t environment, LightTable& table);

/// The environment's map, sampled by its brightness; appends to the table's cumulative. None: there is no map, or it is black.
std::optional<LightEntry> map_light(const Scene& scene, const Band& band, double world_radius_m, LightTable& table);

}  // namespace kuafu
