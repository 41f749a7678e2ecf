// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/winner.h"

#include <algorithm>

namespace simsense::reference {
namespace {

bool unique(const uint16_t* cost, size_t disparities, size_t winner, uint32_t ratio) {
  for (size_t d = 0; d < disparities; ++d) {
    const bool neighbour = d + 1 >= winner && d <= winner + 1;
    if (!neighbour && cost[d] * (100u - ratio) < cost[winner] * 100u) return false;
  }
  return true;
}

/// Offset of the vertex of the parabola through (-1, before), (0, lowest), (1, after).
float parabola_vertex(int before, int lowest, int after) {
  const int curvature = before - 2 * lowest + after;
  return curvature == 0 ? 0.0f : -static_cast<float>(after - before) / static_cast<float>(2 * curvature);
}

/// Apex of the V with equal slopes whose steeper side passes through (0, lowest) and the higher neighbour.
float equiangular_apex(int before, int lowest, int after) {
  const int depth = std::max(before, after) - lowest;
  return depth == 0 ? 0.0f : -static_cast<float>(after - before) / static_cast<float>(2 * depth);
}

float subpixel_offset(Subpixel subpixel, const uint16_t* cost, const uint16_t* block_cost, size_t winner) {
  if (subpixel == Subpixel::none) return 0.0f;
  if (subpixel == Subpixel::parabola) return parabola_vertex(cost[winner - 1], cost[winner], cost[winner + 1]);
  const bool minimum = subpixel == Subpixel::equiangular && block_cost && block_cost[winner] <= block_cost[winner - 1] &&
                       block_cost[winner] <= block_cost[winner + 1];
  const uint16_t* c = minimum ? block_cost : cost;
  return equiangular_apex(c[winner - 1], c[winner], c[winner + 1]);
}

}  // namespace

Grid<float> left_winner(const Volume<uint16_t>& cost, uint32_t uniqueness_ratio, Subpixel subpixel, const Volume<uint16_t>* block_cost) {
  Grid<float> disparity(cost.width, cost.height, -1.0f);
  for (size_t y = 0; y < cost.height; ++y) {
    for (size_t x = 0; x < cost.width; ++x) {
      const uint16_t* c = cost.at(x, y);
      const size_t winner = static_cast<size_t>(std::min_element(c, c + cost.disparities) - c);
      if (!unique(c, cost.disparities, winner, uniqueness_ratio)) continue;
      const bool interior = winner > 0 && winner + 1 < cost.disparities;
      const float offset = interior ? subpixel_offset(subpixel, c, block_cost ? block_cost->at(x, y) : nullptr, winner) : 0.0f;
      disparity.at(x, y) = static_cast<float>(winner) + offset;
    }
  }
  return disparity;
}

Grid<float> confidence(const Volume<uint16_t>& cost) {
  Grid<float> out(cost.width, cost.height);
  for (size_t y = 0; y < cost.height; ++y) {
    for (size_t x = 0; x < cost.width; ++x) {
      const uint16_t* c = cost.at(x, y);
      const size_t winner = static_cast<size_t>(std::min_element(c, c + cost.disparities) - c);
      uint16_t second = UINT16_MAX;
      for (size_t d = 0; d < cost.disparities; ++d) {
        if (d + 1 < winner || d > winner + 1) second = std::min(second, c[d]);
      }
      out.at(x, y) = second == 0 ? 0.0f : 1.0f - static_cast<float>(c[winner]) / static_cast<float>(second);
    }
  }
  return out;
}

Grid<uint32_t> right_winner(const Volume<uint16_t>& cost, int32_t min_disparity) {
  Grid<uint32_t> disparity(cost.width, cost.height);
  for (size_t y = 0; y < cost.height; ++y) {
    for (size_t x = 0; x < cost.width; ++x) {
      uint32_t lowest = UINT32_MAX;
      for (size_t d = 0; d < cost.disparities; ++d) {
        const ptrdiff_t left_x = static_cast<ptrdiff_t>(x + d) + min_disparity;
        if (left_x < 0 || left_x >= static_cast<ptrdiff_t>(cost.width)) continue;
        const uint32_t c = cost.at(static_cast<size_t>(left_x), y)[d];
        if (c >= lowest) continue;
        lowest = c;
        disparity.at(x, y) = static_cast<uint32_t>(d);
      }
    }
  }
  return disparity;
}

}  // namespace simsense::reference
