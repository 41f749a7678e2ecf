#include "light/light_table.h"

#include <algorithm>
#include <span>

namespace kuafu {
namespace {

LightRecord record_of(const Light& light, const glm::vec3& intensity, const Scene& scene,
                      const std::function<PatternAddress(uint32_t)>& pattern) {
  LightRecord r{};
  r.kind = light.kind == Light::Kind::projector ? light_projector : light_point;
  r.position = glm::vec3(light.light_to_world[3]);
  r.intensity = intensity;
  if (r.kind != light_projector) return r;
  const Texture& texture = scene.textures()[light.texture];
  r.width = texture.width;
  r.height = texture.height;
  const PatternAddress plane = pattern(light.texture);
  r.pattern = plane.address;
  r.pattern_bits = plane.bits;
  const glm::dmat3 to_pixel = glm::transpose(light.k * glm::inverse(glm::dmat3(light.light_to_world)));
  for (int row = 0; row < 3; ++row) r.world_to_pixel[row] = glm::vec3(to_pixel[row]);
  return r;
}

// Power up to a common factor; a projector's is its brightest direction's, which errs to the safe side.
double weight_of(const LightRecord& light) { return std::max({light.intensity.x, light.intensity.y, light.intensity.z}); }

void set_chances(std::span<LightRecord> lights, float LightRecord::*probability, float LightRecord::*cumulative) {
  double sum = 0, running = 0;
  for (const LightRecord& l : lights) sum += weight_of(l);
  for (LightRecord& l : lights) {
    running += weight_of(l);
    l.*probability = float(weight_of(l) / sum);
    l.*cumulative = float(running / sum);
  }
}

uint32_t add_environment(LightTable& table, std::vector<LightRecord> seen) {
  const auto others = std::ranges::stable_partition(seen, [](const LightRecord& l) { return l.kind == light_projector; });
  const auto projectors = uint32_t(others.begin() - seen.begin());
  set_chances(seen, &LightRecord::probability, &LightRecord::cumulative);
  set_chances(std::span(seen).subspan(projectors), &LightRecord::other_probability, &LightRecord::other_cumulative);
  const auto first = uint32_t(table.lights.size());
  table.lights.insert(table.lights.end(), seen.begin(), seen.end());
  table.environments.push_back({glm::vec3(0), first, projectors, uint32_t(seen.size())});
  return projectors;
}

}  // namespace

LightTable make_light_table(const Scene& scene, const Band& band, uint32_t environment_count,
                            const std::function<PatternAddress(uint32_t)>& pattern) {
  LightTable table;
  uint32_t most_lights = 0, most_projectors = 0;
  for (uint32_t e = 0; e < environment_count; ++e) {
    std::vector<LightRecord> seen;
    for (const auto& light : scene.lights()) {
      if (!light || (light->environment != none && light->environment != e)) continue;
      const glm::vec3 intensity = band.intensity(light->intensity, light->ir_intensity);
      if (intensity == glm::vec3(0) || (light->kind == Light::Kind::projector && light->texture == none)) continue;
      seen.push_back(record_of(*light, intensity, scene, pattern));
    }
    most_lights = std::max(most_lights, uint32_t(seen.size()));
    most_projectors = std::max(most_projectors, add_environment(table, std::move(seen)));
  }
  const Environment& environment = scene.environment();
  for (EnvironmentRecord& e : table.environments) e.radiance = band.environment(environment.radiance, environment.ir_radiance);
  table.select_lights = most_lights > few_lights;
  table.shadow_rays_per_vertex = table.select_lights ? most_projectors + 1 : most_lights;
  return table;
}

}  // namespace kuafu
