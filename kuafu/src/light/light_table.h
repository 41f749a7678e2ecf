// SPDX-License-Identifier: Apache-2.0
// The lights that each environment sees, as shaders read them: projectors first, then those without extent, emissive surfaces, and those
// that rays meet; with chances by power. Thread rule: pure functions.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "frame/band.h"
#include "scene/scene.h"
#include "shared/scene_records.h"

namespace kuafu {

struct LightTable {
  std::vector<LightRecord> lights;   // environment after environment; those that are dark in the band are left out
  std::vector<LightShape> shapes;    // as lights
  std::vector<LightMotion> motions;  // as lights
  std::vector<EnvironmentRecord> environments;
  std::vector<float> cumulative;    // of meshes and maps
  std::vector<uint32_t> triangles;  // of meshes: instance and primitive
  uint32_t shadow_rays_per_vertex = 0;
  bool select_lights = false;  // more than few_lights somewhere: each vertex asks one light, chosen by power
  bool has_shapes = false;     // some light needs its LightShape
};

inline constexpr uint32_t few_lights = 4;

/// Half the scene's diagonal, m, for the power of infinitely distant lights; 0 if there are none.
double world_radius_m(const Scene& scene);

/// A projector's pattern in the memory of the stages.
struct PatternAddress {
  uint64_t address;
  uint32_t bits;
};

/// Makes the table of all lights. `pattern` returns the plane of a projector's pattern. Lights that are dark while the shutters are open
/// are left out.
LightTable make_light_table(const Scene& scene, const Band& band, uint32_t environment_count,
                            const std::function<PatternAddress(const Light&)>& pattern, const TimeSpan& open);

/// A light without extent, in one environment; beams carry its light through glass.
struct SharpLight {
  uint32_t index, environment;  // of LightTable
  bool directional;
  glm::vec3 position;   // of one that is not directional
  glm::vec3 direction;  // of a directional one's light, unit
};

std::vector<SharpLight> sharp_lights(const LightTable& table);

/// A light of the scene as shaders read it: a single one (light_record.cpp), or one that surfaces or the environment's map make
/// (emitters.cpp).
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
