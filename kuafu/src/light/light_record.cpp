// SPDX-License-Identifier: Apache-2.0
#include "light/light_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "scene/motion.h"

namespace kuafu {
namespace {

constexpr double pi = std::numbers::pi;

static_assert(uint32_t(Light::Kind::point) == light_point && uint32_t(Light::Kind::projector) == light_projector &&
                  uint32_t(Light::Kind::directional) == light_directional && uint32_t(Light::Kind::spot) == light_spot &&
                  uint32_t(Light::Kind::rectangle) == light_rectangle && uint32_t(Light::Kind::disk) == light_disk,
              "scene and shaders number the kinds alike");

/// K with the pattern magnified about its principal point.
glm::dmat3 scaled_k(const Light& light) {
  glm::dmat3 k = light.k;
  for (const glm::ivec2 at : {glm::ivec2(0, 0), glm::ivec2(1, 0), glm::ivec2(1, 1)}) k[at.x][at.y] /= light.pattern_scale;
  return k;
}

void set_projector(LightEntry& e, const Light& light, const Scene& scene, const std::function<PatternAddress(const Light&)>& pattern) {
  const Texture& texture = pattern_of(scene, light);
  const PatternAddress plane = pattern(light);
  e.record.width = texture.width;
  e.record.height = texture.height;
  e.record.pattern = plane.address;
  e.record.pattern_bits = plane.bits;
  const glm::dmat3 to_pixel = glm::transpose(scaled_k(light) * glm::inverse(glm::dmat3(light.light_to_world)));
  for (int row = 0; row < 3; ++row) e.record.world_to_pixel[row] = glm::vec3(to_pixel[row]);
}

/// Tangent of the angle from the axis beyond which the lens folds back, and would show the pattern twice.
double lens_reach(const Distortion& lens) {
  constexpr double step = 1e-3, last = 20, everywhere = 1e18;
  if (!distorts(lens)) return everywhere;  // a batch of environments has many such
  Distortion radial = lens;
  if (lens.model == lens_brown_conrady) radial.k[2] = radial.k[3] = 0;
  const auto distorted = [&](double r) { return distort(radial, {r, 0}).x; };
  double r = 0;
  while (r < last && distorted(r + step) > distorted(r)) r += step;
  return r < last ? r : everywhere;
}

void set_lens(LightEntry& e, const Light& light) {
  LightShape& s = e.shape;
  const glm::dmat3 k = scaled_k(light);
  s.focal = glm::vec2(k[0][0], k[1][1]);
  s.centre = glm::vec2(k[2][0], k[2][1]);
  s.skew = float(k[1][0]);
  s.lens_reach = float(lens_reach(light.lens));
  e.shaped = light.falloff > 0 || (light.focus_m > 0 && light.radius_m > 0) || distorts(light.lens);
}

double power_of(const Light& light, double brightness, double world_radius_m) {
  switch (light.kind) {
    case Light::Kind::directional:
      return brightness * pi * world_radius_m * world_radius_m;
    case Light::Kind::spot:
      return brightness * 2 * pi * (1 - std::cos(light.outer_rad));
    case Light::Kind::rectangle:
      return brightness * pi * light.size_m.x * light.size_m.y;
    case Light::Kind::disk:
      return brightness * pi * pi * light.radius_m * light.radius_m;
    default:
      return brightness * 4 * pi;  // a projector's is its brightest direction's
  }
}

}  // namespace

double brightness(const glm::vec3& value) { return std::max({value.x, value.y, value.z}); }

LightEntry light_entry(const Light& light, const glm::vec3& intensity, const Scene& scene, double world_radius_m,
                       const std::function<PatternAddress(const Light&)>& pattern) {
  LightEntry e;
  e.record.kind = uint32_t(light.kind);
  e.record.position = glm::vec3(light.light_to_world[3]);
  e.record.intensity = intensity;
  e.record.light_group = light.light_group;
  e.motion = {motion_record(light.light_to_world, light.velocity), float(light.on_from_s), float(light.on_until_s)};
  e.power = power_of(light, brightness(intensity), world_radius_m);
  LightShape& s = e.shape;
  copy_fields(light, s);
  s.texture = slot_or_none(scene.textures(), light.texture);
  s.axis_x = glm::vec3(light.light_to_world[0]);
  s.axis_y = glm::vec3(light.light_to_world[1]);
  s.axis_z = glm::vec3(light.light_to_world[2]);
  s.half_size = glm::vec2(light.size_m * 0.5);
  const double half_sine = std::sin(light.angle_rad / 2);
  s.one_minus_cos = float(2 * half_sine * half_sine);
  s.cos_inner = float(std::cos(light.inner_rad));
  s.cos_outer = float(std::cos(light.outer_rad));
  if (light.kind == Light::Kind::projector) {
    set_projector(e, light, scene, pattern);
    set_lens(e, light);
  } else {
    e.shaped = light.kind != Light::Kind::point || light.range_m > 0 || light.radius_m > 0 || light.texture != none;
  }
  const bool sphere = light.kind == Light::Kind::point && light.radius_m > 0,
             disc = light.kind == Light::Kind::directional && light.angle_rad > 0;
  e.met = sphere || disc || light.kind == Light::Kind::rectangle || light.kind == Light::Kind::disk;
  return e;
}

}  // namespace kuafu
