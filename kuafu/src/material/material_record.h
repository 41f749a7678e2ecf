// SPDX-License-Identifier: Apache-2.0
// A material as shaders read it, in the band being rendered. Thread rule: pure functions.
#pragma once

#include "frame/band.h"
#include "scene/scene.h"
#include "shared/scene_records.h"

namespace kuafu {

/// Returns the material with its values in this band in place of the visible ones.
Material in_band(const Material& material, const Band& band);

/// Returns a material as shaders read it; textures are named by their slots.
MaterialRecord material_record(const Material& material, uint32_t id, const Band& band, const Table<Texture>& textures);

/// Returns the feature_* flags that shaders need for the material.
uint32_t material_features(const Material& material);

/// Whether the material transmits light, perhaps only where a texture lowers its metalness.
bool is_glass(const Material& material);

/// Whether a shadow ray may pass the material, perhaps only by a texture, and whether it bends light: it then bounds a body.
bool is_smooth_glass(const Material& material);
bool bends_light(const Material& material);

/// Whether the material is rough glass that bounds a body, which needs the albedos of glass (material/albedo_tables.h).
bool is_frosted(const Material& material);

/// Whether the material needs the albedos of sheen.
bool has_sheen(const Material& material);

/// The material of an instance that names none: grey and Lambertian.
Material grey_default();

}  // namespace kuafu
