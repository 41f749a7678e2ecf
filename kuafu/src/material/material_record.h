// SPDX-License-Identifier: Apache-2.0
// A material as shaders read it, in the band being rendered. Thread rule: pure functions.
#pragma once

#include "frame/band.h"
#include "scene/scene.h"
#include "shared/scene_records.h"

namespace kuafu {

/// The material with what it is in the band in the place of what it is in the visible one.
Material in_band(const Material& material, const Band& band);

/// Its textures are told by their slots.
MaterialRecord material_record(const Material& material, uint32_t id, const Band& band, const Table<Texture>& textures);

/// feature_* that shaders need for it.
uint32_t material_features(const Material& material);

/// Glass, if only where a texture takes metal away.
bool is_glass(const Material& material);

/// Glass that a shadow ray may pass, if only where a texture says so, and whether it bends it: it then bounds a body.
bool is_smooth_glass(const Material& material);
bool bends_light(const Material& material);

/// A body of rough glass: its albedos are to be in the table (material/albedo_tables.h).
bool is_frosted(const Material& material);

/// Sheen's albedos are to be in the table.
bool has_sheen(const Material& material);

/// What stands in where an instance names no material: grey and Lambertian.
Material grey_default();

}  // namespace kuafu
