// SPDX-License-Identifier: Apache-2.0
// What a projector throws onto a wall: its power, where it lands, how far it spreads.
#pragma once

#include "kuafu/world.h"

namespace laws {

struct Spot {
  double power = 0, x = 0, y = 0,
         spread = 0;  // sum of intensities over the pattern's pixels; tangents; mean square distance from the centre
};

/// A white wall at distance_m seen from a projector of side x side pixels, `zoom` of them to one of its pattern; I = pi L d^2 / cos^3.
inline Spot spot_on_wall(World& world, double distance_m, uint32_t side, double focal_px) {
  constexpr double zoom = 6;
  world.add(quad({0, 0, distance_m}, {-2 * distance_m, 0, 0}, {0, 2 * distance_m, 0}), lambert(1.0f));
  const auto pixels = uint32_t(side * zoom);
  const double f = focal_px * zoom;
  const Pixels image = world.radiance(view_at({0, 0, 0}, pixels, pixels, f), 16, 0);
  Spot spot;
  double squares = 0;
  for (uint32_t r = 0; r < pixels; ++r)
    for (uint32_t c = 0; c < pixels; ++c) {
      const double x = (c - (pixels - 1) / 2.0) / f, y = (r - (pixels - 1) / 2.0) / f;
      const double intensity = image.at(0, r, c) * pi * distance_m * distance_m * std::pow(1 + x * x + y * y, 1.5) / (zoom * zoom);
      spot.power += intensity;
      spot.x += intensity * x;
      spot.y += intensity * y;
      squares += intensity * (x * x + y * y);
    }
  spot.x /= spot.power;
  spot.y /= spot.power;
  spot.spread = squares / spot.power - spot.x * spot.x - spot.y * spot.y;
  return spot;
}

}  // namespace laws
