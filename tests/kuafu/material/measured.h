// SPDX-License-Identifier: Apache-2.0
// What tests measure of a material: its image in a white furnace, and what it reflects of a lamp.
#pragma once

#include "kuafu/world.h"

namespace laws {

/// Image of a plane, or of another shape, that fills the view 1 m away in an environment of radiance 1, seen at `angle` from its normal.
inline Pixels in_furnace(const kuafu_material_desc& material, double angle, uint32_t samples = 256, uint32_t tracer = KUAFU_TRACER_AUTO,
                         const Shape& shape = quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0})) {
  World world(tracer);
  world.add(shape, material, placed({0, 0, 1}, angle));
  world.set_environment(1.0f);
  world.desc().samples_per_pixel = samples;
  return world.radiance(view_at({0, 0, 0}, 8, 8, 2000));
}

/// Radiance of a plane at the origin towards `view_angle`, lit by a lamp at `light_angle`, both in the xz plane; per irradiance.
inline double brdf(const kuafu_material_desc& material, double view_angle, double light_angle, uint32_t tracer = KUAFU_TRACER_AUTO) {
  World world(tracer);
  world.add(quad({0, 0, 0}, {-0.01, 0, 0}, {0, 0.01, 0}), material);  // faces -z
  world.add_point({10 * std::sin(light_angle), 0, -10 * std::cos(light_angle)}, 100.0f);
  world.desc().samples_per_pixel = 1;
  world.desc().max_bounces = 0;
  const Vec3 eye{std::sin(view_angle), 0, -std::cos(view_angle)};
  return world.radiance(view_at(eye, 3, 3, 40000, -view_angle)).at(0, 1, 1) / std::cos(light_angle);
}

}  // namespace laws
