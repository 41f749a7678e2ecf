// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/match.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <utility>

namespace simsense::reference {

namespace {

struct Window {
  ConstImage image;
  ptrdiff_t width, height, x, y;
  bool repeats_edge;

  [[nodiscard]] int pixel(ptrdiff_t dx, ptrdiff_t dy) const {
    const ptrdiff_t px = std::clamp<ptrdiff_t>(x + dx, 0, width - 1), py = std::clamp<ptrdiff_t>(y + dy, 0, height - 1);
    const bool outside = px != x + dx || py != y + dy;
    return outside && !repeats_edge ? 0 : static_cast<int>(image.at(px, py));
  }
  /// Largest less smallest count, up to half_width columns and half_height rows away.
  [[nodiscard]] int range(ptrdiff_t half_width, ptrdiff_t half_height) const {
    int low = pixel(0, 0), high = low;
    for (ptrdiff_t dy = -half_height; dy <= half_height; ++dy) {
      for (ptrdiff_t dx = -half_width; dx <= half_width; ++dx) {
        low = std::min(low, pixel(dx, dy));
        high = std::max(high, pixel(dx, dy));
      }
    }
    return high - low;
  }
};

}  // namespace

Grid<uint64_t> census(ConstImage image, size_t width, size_t height, const MatchParameters& p) {
  constexpr ptrdiff_t margin = MatchParameters::contrast_margin;
  const ptrdiff_t half_width = p.census_width / 2, half_height = p.census_height / 2;
  const size_t cell_count = size_t{p.census_width} * p.census_height;
  const bool plain = p.census_kind == CensusKind::plain, with_contrast = p.census_contrast_256ths > 0;
  Grid<uint64_t> words(width, height);
  for (size_t y = 0; y < height; ++y) {
    for (size_t x = 0; x < width; ++x) {
      const Window window{
          image,        static_cast<ptrdiff_t>(width), static_cast<ptrdiff_t>(height), static_cast<ptrdiff_t>(x), static_cast<ptrdiff_t>(y),
          with_contrast};
      const int share =
          with_contrast ? static_cast<int>(p.census_contrast_256ths) * window.range(half_width + margin, half_height + margin) : 0;
      const int needed = with_contrast ? std::max(share, 256 * static_cast<int>(p.census_noise_dn)) : 0;
      size_t bit = 0;
      for (size_t cell = 0; cell < cell_count; ++cell) {
        if (cell == cell_count / 2) {  // the centre; what follows are mirrors
          if (!plain) break;
          continue;
        }
        const ptrdiff_t dx = static_cast<ptrdiff_t>(cell % p.census_width) - half_width;
        const ptrdiff_t dy = static_cast<ptrdiff_t>(cell / p.census_width) - half_height;
        int brighter = plain ? window.pixel(0, 0) : window.pixel(dx, dy), darker = plain ? window.pixel(dx, dy) : window.pixel(-dx, -dy);
        if (!plain && with_contrast && bit % 2 == 1) std::swap(brighter, darker);
        const bool equal_counts = !plain && !with_contrast;
        const bool set = equal_counts ? brighter >= darker : 256 * (brighter - darker) > needed;
        words.at(x, y) |= uint64_t{set} << bit++;
      }
    }
  }
  return words;
}

Volume<uint16_t> hamming_cost(const Grid<uint64_t>& left, const Grid<uint64_t>& right, size_t disparities, int32_t min_disparity) {
  const ptrdiff_t last_x = static_cast<ptrdiff_t>(left.width) - 1;
  Volume<uint16_t> cost(left.width, left.height, disparities);
  for (size_t y = 0; y < left.height; ++y) {
    for (size_t x = 0; x < left.width; ++x) {
      for (size_t d = 0; d < disparities; ++d) {
        const ptrdiff_t right_x = std::clamp<ptrdiff_t>(static_cast<ptrdiff_t>(x) - min_disparity - static_cast<ptrdiff_t>(d), 0, last_x);
        cost.at(x, y)[d] = static_cast<uint16_t>(std::popcount(left.at(x, y) ^ right.at(static_cast<size_t>(right_x), y)));
      }
    }
  }
  return cost;
}

Volume<uint16_t> block_sum(const Volume<uint16_t>& cost, size_t block_width, size_t block_height) {
  const auto add_rows = [](const uint16_t* in, uint16_t* out, size_t rows, size_t columns, size_t count) {
    const cv::Size size(static_cast<int>(columns), static_cast<int>(rows));
    cv::Mat sums(size, CV_16U, out);
    cv::boxFilter(cv::Mat(size, CV_16U, const_cast<uint16_t*>(in)), sums, -1, {1, static_cast<int>(count)}, {-1, -1}, false,
                  cv::BORDER_REPLICATE);
  };
  Volume<uint16_t> lines = cost, sum = cost;
  for (size_t y = 0; y < cost.height; ++y) add_rows(cost.at(0, y), lines.at(0, y), cost.width, cost.disparities, block_width);
  add_rows(lines.at(0, 0), sum.at(0, 0), cost.height, cost.width * cost.disparities, block_height);
  return sum;
}

namespace {

/// One pixel further along a path: `path` holds L_r(p-r, .) and becomes L_r(p, .).
void step(const uint16_t* cost, uint32_t p1, uint32_t p2, std::vector<uint32_t>& path) {
  const size_t disparities = path.size();
  const uint32_t lowest = *std::min_element(path.begin(), path.end());
  uint32_t below = path[1];  // d = 0 and d = D - 1 lack one neighbour and use the other twice
  for (size_t d = 0; d < disparities; ++d) {
    const uint32_t here = path[d];
    const uint32_t above = d + 1 < disparities ? path[d + 1] : below;
    path[d] = cost[d] + std::min({here, below + p1, above + p1, lowest + p2}) - lowest;
    below = here;
  }
}

/// Follows the path that starts at (x, y) to the image's border and adds L_r to the sum.
void follow(const Volume<uint16_t>& cost, const JumpPenalty& penalty, uint32_t area, ptrdiff_t x, ptrdiff_t y, ptrdiff_t step_x,
            ptrdiff_t step_y, Volume<uint32_t>& sum) {
  const auto inside = [&] { return x >= 0 && y >= 0 && x < static_cast<ptrdiff_t>(cost.width) && y < static_cast<ptrdiff_t>(cost.height); };
  std::vector<uint32_t> path(cost.disparities, 0);  // all zero before the first pixel makes L_r = C there
  for (bool first = true; inside(); x += step_x, y += step_y, first = false) {
    const size_t px = static_cast<size_t>(x), py = static_cast<size_t>(y);
    const uint32_t p2 = first ? 0 : penalty.between(x, y, x - step_x, y - step_y);
    step(cost.at(px, py), penalty.p1 * area, p2 * area, path);
    for (size_t d = 0; d < path.size(); ++d) sum.at(px, py)[d] += path[d];
  }
}

}  // namespace

uint32_t JumpPenalty::between(ptrdiff_t x, ptrdiff_t y, ptrdiff_t other_x, ptrdiff_t other_y) const {
  if (full_gradient == 0) return p2;
  const auto gradient = static_cast<uint32_t>(std::abs(static_cast<int>(image.at(x, y)) - static_cast<int>(image.at(other_x, other_y))));
  return gradient <= full_gradient ? p2 : std::max(p1, p2 * full_gradient / gradient);
}

Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, uint32_t p1, uint32_t p2) { return aggregate(cost, {p1, p2}, 1, 4); }

Volume<uint16_t> aggregate(const Volume<uint16_t>& cost, const JumpPenalty& penalty, uint32_t block_area, uint32_t path_count) {
  Volume<uint32_t> sum(cost.width, cost.height, cost.disparities);
  const ptrdiff_t right = static_cast<ptrdiff_t>(cost.width) - 1, bottom = static_cast<ptrdiff_t>(cost.height) - 1;
  const ptrdiff_t steps[8][2] = {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {-1, 1}, {1, -1}};
  for (uint32_t r = 0; r < path_count; ++r) {
    const auto [step_x, step_y] = steps[r];
    for (ptrdiff_t y = 0; y <= bottom; ++y) {
      for (ptrdiff_t x = 0; x <= right; ++x) {  // a path starts at every pixel whose predecessor lies outside
        const ptrdiff_t before_x = x - step_x, before_y = y - step_y;
        const bool enters = before_x < 0 || before_y < 0 || before_x > right || before_y > bottom;
        if (enters) follow(cost, penalty, block_area, x, y, step_x, step_y, sum);
      }
    }
  }
  Volume<uint16_t> mean(cost.width, cost.height, cost.disparities);
  std::transform(sum.data.begin(), sum.data.end(), mean.data.begin(),
                 [path_count](uint32_t s) { return static_cast<uint16_t>(s / path_count); });
  return mean;
}

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

Grid<float> left_right_check(const Grid<float>& left, const Grid<uint32_t>& right, int32_t max_diff, int32_t min_disparity,
                             Grid<MatchReason>* reason) {
  const auto note = [&](size_t x, size_t y, MatchReason why) {
    if (reason) reason->at(x, y) = why;
  };
  Grid<float> checked(left.width, left.height, -1.0f);
  for (size_t y = 0; y < left.height; ++y) {
    for (size_t x = 0; x < left.width; ++x) {
      const float disparity = left.at(x, y);
      if (disparity < 0.0f) continue;
      const int rounded = static_cast<int>(std::floor(disparity + 0.5f));
      const int right_x = static_cast<int>(x) - rounded - min_disparity;
      if (right_x < 0 || right_x >= static_cast<int>(left.width)) {
        note(x, y, MatchReason::outside);
        continue;
      }
      const int right_disparity = static_cast<int>(right.at(static_cast<size_t>(right_x), y));
      if (std::abs(rounded - right_disparity) <= max_diff) {
        checked.at(x, y) = disparity;
      } else {
        note(x, y, MatchReason::occluded);
      }
    }
  }
  return checked;
}

Grid<float> median(const Grid<float>& disparity, size_t size) {
  const size_t half = size / 2;
  Grid<float> filtered = disparity;
  std::vector<float> window(size * size);
  for (size_t y = half; y + half < disparity.height; ++y) {
    for (size_t x = half; x + half < disparity.width; ++x) {
      for (size_t k = 0; k < window.size(); ++k) window[k] = disparity.at(x + k % size - half, y + k / size - half);
      std::nth_element(window.begin(), window.begin() + static_cast<ptrdiff_t>(window.size() / 2), window.end());
      filtered.at(x, y) = window[window.size() / 2];
    }
  }
  return filtered;
}

}  // namespace simsense::reference
