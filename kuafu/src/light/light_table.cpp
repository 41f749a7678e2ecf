// SPDX-License-Identifier: Apache-2.0
#include "light/light_table.h"

#include <algorithm>

namespace kuafu {
namespace {

/// Projectors, lights without extent, the surfaces' light, lights that rays meet.
int rank(const LightEntry& e) {
  if (e.record.kind == light_projector) return 0;
  if (e.record.kind == light_mesh) return 2;
  return e.met ? 3 : 1;
}

void set_chances(std::vector<LightEntry>& lights, size_t first, float LightRecord::*probability, float LightRecord::*cumulative) {
  double sum = 0, running = 0;
  for (size_t i = first; i < lights.size(); ++i) sum += lights[i].power;
  for (size_t i = first; i < lights.size(); ++i) {
    running += lights[i].power;
    lights[i].record.*probability = float(lights[i].power / sum);
    lights[i].record.*cumulative = float(running / sum);
  }
}

uint32_t add_environment(LightTable& table, std::vector<LightEntry> seen) {
  std::ranges::stable_sort(seen, {}, rank);
  const auto begin_of = [&](int from) {
    return uint32_t(std::ranges::find_if(seen, [&](const LightEntry& e) { return rank(e) >= from; }) - seen.begin());
  };
  const uint32_t first = uint32_t(table.lights.size()), projectors = begin_of(1), mesh = begin_of(2), shapes = begin_of(3);
  set_chances(seen, 0, &LightRecord::probability, &LightRecord::cumulative);
  set_chances(seen, projectors, &LightRecord::other_probability, &LightRecord::other_cumulative);
  for (const LightEntry& e : seen) {
    table.lights.push_back(e.record);
    table.shapes.push_back(e.shape);
    table.motions.push_back(e.motion);
    table.has_shapes = table.has_shapes || e.shaped;
  }
  table.environments.push_back({.radiance = glm::vec3(0),
                                .first_light = first,
                                .projector_count = projectors,
                                .light_count = uint32_t(seen.size()),
                                .first_shape = shapes,
                                .mesh_light = mesh < shapes ? first + mesh : miss,
                                .light_group = 0});
  return projectors;
}

bool is_dark(const Light& light, const TimeSpan& open) {
  return light.has_window() && (light.on_until_s <= open.from_s || light.on_from_s > open.until_s);
}

}  // namespace

double world_radius_m(const Scene& scene) {
  const auto needs = [](const auto& light) { return light && light->kind == Light::Kind::directional; };
  if (scene.environment().texture == none && std::ranges::none_of(scene.lights(), needs)) return 0;
  const Bounds bounds = scene.rough_bounds();
  return bounds.min.x <= bounds.max.x ? std::max(1e-3, glm::length(bounds.max - bounds.min) / 2) : 1;
}

LightTable make_light_table(const Scene& scene, const Band& band, uint32_t environment_count,
                            const std::function<PatternAddress(const Light&)>& pattern, const TimeSpan& open) {
  LightTable table;
  uint32_t most_lights = 0, most_projectors = 0;
  const double radius_m = world_radius_m(scene);
  const std::optional<LightEntry> map = map_light(scene, band, radius_m, table);
  for (uint32_t e = 0; e < environment_count; ++e) {
    std::vector<LightEntry> seen;
    for (const auto& light : scene.lights()) {
      if (!light || (light->environment != none && light->environment != e)) continue;
      if (is_dark(*light, open)) continue;
      const glm::vec3 intensity = band.intensity(light->intensity, light->ir_intensity, light->ir_share);
      if (intensity == glm::vec3(0) || (light->kind == Light::Kind::projector && light->texture == none && !light->raster)) continue;
      seen.push_back(light_entry(*light, intensity, scene, radius_m, pattern));
    }
    if (const auto mesh = mesh_light(scene, band, e, table)) seen.push_back(*mesh);
    if (map) seen.push_back(*map);
    most_lights = std::max(most_lights, uint32_t(seen.size()));
    most_projectors = std::max(most_projectors, add_environment(table, std::move(seen)));
  }
  const Environment& environment = scene.environment();
  const glm::vec3 radiance = environment.texture == none ? band.environment(environment.radiance, environment.ir_radiance) : glm::vec3(0);
  for (EnvironmentRecord& e : table.environments) {
    e.radiance = radiance;
    e.light_group = environment.light_group;
  }
  table.select_lights = most_lights > few_lights;
  table.shadow_rays_per_vertex = table.select_lights ? most_projectors + 1 : most_lights;
  return table;
}

std::vector<SharpLight> sharp_lights(const LightTable& table) {
  std::vector<SharpLight> out;
  for (uint32_t e = 0; e < table.environments.size(); ++e)
    for (uint32_t k = 0; k < table.environments[e].light_count; ++k) {
      const uint32_t index = table.environments[e].first_light + k;
      const LightRecord& light = table.lights[index];
      const LightShape& shape = table.shapes[index];
      const bool directional = light.kind == light_directional && shape.one_minus_cos == 0.0f;
      const bool point = light.kind == light_projector || light.kind == light_spot || (light.kind == light_point && shape.radius_m == 0.0f);
      if (directional || point)
        out.push_back(
            {.index = index, .environment = e, .directional = directional, .position = light.position, .direction = shape.axis_z});
    }
  return out;
}

}  // namespace kuafu
