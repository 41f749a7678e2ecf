// SPDX-License-Identifier: Apache-2.0
// What tests measure of a material: its image in a white furnace, what it reflects of a lamp, what lets light through; and Fresnel's law.
#pragma once

#include "kuafu/world.h"

namespace laws {

/// Image of a plane, or of another shape, that fills the view 1 m away in an environment of radiance 1, seen at `angle` from its normal.
inline Pixels in_furnace(const kuafu_material_desc& material, double angle, uint32_t samples = 256, uint32_t tracer = KUAFU_TRACER_AUTO,
                         const Shape& shape = quad({0, 0, 0}, {-50, 0, 0}, {0, 50, 0})) {
  World world(tracer);
  world.add(shape, material, placed({0, 0, 1}, angle));
  world.set_environment(1.0f);
  return world.radiance(view_at({0, 0, 0}, 8, 8, 2000), samples);
}

/// Radiance of a plane at the origin towards `view_angle`, lit by a lamp at `light_angle`, both in the xz plane; per irradiance.
inline double brdf(const kuafu_material_desc& material, double view_angle, double light_angle, uint32_t tracer = KUAFU_TRACER_AUTO) {
  World world(tracer);
  world.add(quad({0, 0, 0}, {-0.01, 0, 0}, {0, 0.01, 0}), material);  // faces -z
  world.add_point({10 * std::sin(light_angle), 0, -10 * std::cos(light_angle)}, 100.0f);
  const Vec3 eye{std::sin(view_angle), 0, -std::cos(view_angle)};
  return world.radiance(view_at(eye, 3, 3, 40000, -view_angle), 1, 0).at(0, 1, 1) / std::cos(light_angle);
}

/// A lamp behind something that scatters what it lets through.
inline void expect_samplings_agree_through(const Shape& glass, const kuafu_material_desc& material, uint32_t samples, uint32_t bounces) {
  const auto mean = [&](uint32_t sampling) {
    World world;
    world.add(glass, material, placed({0, 0, 1}, 0.3));
    world.add(quad({0, 0, 2}, {-0.3, 0, 0}, {0, 0.3, 0}), emitter(1.0f));
    world.desc().light_sampling = sampling;
    return world.radiance(view_at({0, 0, 0}, 6, 6, 40), samples, bounces).mean();
  };
  expect_samplings_agree(mean, 0.02);
}

/// Reflectance of air to index n, unpolarised (Hecht, Optics, 4.6). angle: of the ray in air, radians.
inline double reflectance(double angle, double n) {
  const double c = std::cos(angle), ct = std::sqrt(1 - std::pow(std::sin(angle) / n, 2));
  const double s = (c - n * ct) / (c + n * ct), p = (n * c - ct) / (n * c + ct);
  return (s * s + p * p) / 2;
}

}  // namespace laws
