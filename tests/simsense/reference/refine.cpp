// SPDX-License-Identifier: Apache-2.0
#include "simsense/reference/match.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "match/refine.h"

namespace simsense::reference {

namespace {

/// What one pixel adds to its windows.
struct Evidence {
  int32_t q = 0;  // its disparity, 32nds of a pixel
  bool counts = false;
  int32_t slope = 0, match_slope = 0, difference = 0;
};

/// Rises over the first twelfth of a pixel, falls to the middle, and is odd about that.
int32_t pull_shape(int32_t q) {
  const int32_t f = q & 31;
  if (f < 3) return 5 * f;
  if (f < 30) return 16 - f;
  return -5 * (32 - f);
}

struct Sums {
  int32_t slope = 0, match_slope = 0, difference = 0, product = 0, texture = 0, count = 0, q = 0;
  int32_t pulled_slope = 0, pulled_match_slope = 0, pulled_product = 0, mixed_texture = 0, pulled_texture = 0;
  void add(const Evidence& one) {
    slope += one.slope;
    match_slope += one.match_slope;
    difference += one.difference;
    product += one.slope * one.difference;
    texture += one.slope * one.match_slope;
    count += one.counts;
    q += one.counts ? one.q : 0;
    const int32_t pulled = (one.slope * pull_shape(one.q) + 4) >> 3, pulled_match = (one.match_slope * pull_shape(one.q) + 4) >> 3;
    pulled_slope += pulled;
    pulled_match_slope += pulled_match;
    pulled_product += pulled * one.difference;
    mixed_texture += pulled * one.match_slope;
    pulled_texture += pulled * pulled_match;
  }
};

/// sum g e and sum g w, less what a constant makes of them.
float less_constant(int32_t sum, int32_t a, int32_t b, float share) {
  const float product = static_cast<float>(a) * static_cast<float>(b);
  const float part = product * share;
  return static_cast<float>(sum) - part;
}

/// Pixels, from 48ths times 8ths over 8ths squared.
float step(float product, float texture) { return std::clamp(product / (6.0f * texture), -REFINE_LARGEST_STEP, REFINE_LARGEST_STEP); }

int32_t rounded(float disparity) {
  const float phases = disparity * REFINE_PHASES;
  return static_cast<int32_t>(std::floor(phases + 0.5f));
}

class Refinement {
 public:
  Refinement(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p)
      : left_(left), right_(right), disparity_(disparity), p_(p), width_(disparity.width), height_(disparity.height) {}

  Grid<float> result() {
    find_cell_steps();
    Grid<Evidence> evidence(width_, height_);
    for (size_t y = 0; y < height_; ++y)
      for (size_t x = 0; x < width_; ++x)
        evidence.at(x, y) = look(x, y, between_cells(cell_steps_, x, y), between_cells(cell_pulls_, x, y));
    Grid<float> out = disparity_;
    for (size_t y = 0; y < height_; ++y)
      for (size_t x = 0; x < width_; ++x)
        if (evidence.at(x, y).counts) out.at(x, y) = refined(evidence, x, y);
    return out;
  }

 private:
  int32_t left_count(ptrdiff_t x, ptrdiff_t y) const {
    const ptrdiff_t inside = std::clamp<ptrdiff_t>(x, 0, static_cast<ptrdiff_t>(width_) - 1);
    return static_cast<int32_t>(refine_count(left_.at(inside, y), left_.element_bytes, p_.left_bits));
  }
  int32_t right_count(ptrdiff_t x, ptrdiff_t y) const {
    return static_cast<int32_t>(refine_count(right_.at(x, y), right_.element_bytes, p_.right_bits));
  }

  Evidence look(size_t column, size_t row, float moved, float pulled) const {
    const auto x = static_cast<ptrdiff_t>(column), y = static_cast<ptrdiff_t>(row), width = static_cast<ptrdiff_t>(width_);
    if (disparity_.at(column, row) == p_.invalid_disparity()) return {};
    Evidence out;
    const float disparity = disparity_.at(column, row), shape = static_cast<float>(pull_shape(rounded(disparity))) / 8.0f;
    const float stepped = disparity + moved, freed = pulled * shape;
    out.q = rounded(stepped + freed);
    const int32_t place = REFINE_PHASES * static_cast<int32_t>(x) - out.q, f = place & (REFINE_PHASES - 1), u = REFINE_PHASES - f;
    const ptrdiff_t i = place >> 5;
    out.counts = i >= 1 && i + 2 < width;
    if (!out.counts) return out;
    const int32_t weights[] = {u * u * u, 3 * f * f * f - 192 * f * f + 131072, 3 * u * u * u - 192 * u * u + 131072, f * f * f};
    const int32_t slopes[] = {-u * u, 3 * f * f - 128 * f, -3 * u * u + 128 * u, f * f};
    int32_t value = 0, slope = 0;
    for (ptrdiff_t k = 0; k < 4; ++k) {
      value += weights[k] * right_count(i - 1 + k, y);
      slope += slopes[k] * right_count(i - 1 + k, y);
    }
    const uint32_t extra = refine_extra_bits(left_.element_bytes);
    const int32_t smooth = 32768 * (left_count(x - 1, y) + 4 * left_count(x, y) + left_count(x + 1, y));
    const auto rise_over = [&](ptrdiff_t reach) { return left_count(x + reach, y) - left_count(x - reach, y); };
    const int32_t rise = rise_over(2) + 2 * rise_over(1) - rise_over(4);
    out.slope = (rise + (1 << extra >> 1)) >> extra;
    out.match_slope = (slope + (128 << extra)) >> (8 + extra);
    out.difference = std::clamp((value - smooth + (2048 << extra)) >> (12 + extra), -REFINE_LARGEST_DIFFERENCE, REFINE_LARGEST_DIFFERENCE);
    return out;
  }

  void find_cell_steps() {
    const size_t columns = (width_ + REFINE_CELL - 1) / REFINE_CELL, rows = (height_ + REFINE_CELL - 1) / REFINE_CELL;
    Grid<float> product(columns, rows), texture(columns, rows), pulled(columns, rows), mixed(columns, rows), pulled_texture(columns, rows);
    for (size_t cy = 0; cy < rows; ++cy)
      for (size_t cx = 0; cx < columns; ++cx) {
        Sums sums;
        for (size_t y = cy * REFINE_CELL; y < std::min(height_, (cy + 1) * REFINE_CELL); y += 2)
          for (size_t x = cx * REFINE_CELL; x < std::min(width_, (cx + 1) * REFINE_CELL); ++x) sums.add(look(x, y, 0, 0));
        product.at(cx, cy) = less_constant(sums.product, sums.slope, sums.difference, REFINE_CELL_SHARE);
        texture.at(cx, cy) = std::max(less_constant(sums.texture, sums.slope, sums.match_slope, REFINE_CELL_SHARE), 0.0f);
        pulled.at(cx, cy) = less_constant(sums.pulled_product, sums.pulled_slope, sums.difference, REFINE_CELL_SHARE);
        mixed.at(cx, cy) = less_constant(sums.mixed_texture, sums.pulled_slope, sums.match_slope, REFINE_CELL_SHARE);
        pulled_texture.at(cx, cy) =
            std::max(less_constant(sums.pulled_texture, sums.pulled_slope, sums.pulled_match_slope, REFINE_CELL_SHARE), 0.0f);
      }
    cell_steps_ = cell_pulls_ = Grid<float>(columns, rows);
    for (size_t cy = 0; cy < rows; ++cy)
      for (size_t cx = 0; cx < columns; ++cx) {
        float e = 0, w = 0, ue = 0, uw = 0, uuw = 0;
        for (size_t y = cy - (cy > 0); y < std::min(rows, cy + 2); ++y)
          for (size_t x = cx - (cx > 0); x < std::min(columns, cx + 2); ++x) {
            e += product.at(x, y), w += texture.at(x, y);
            ue += pulled.at(x, y), uw += mixed.at(x, y), uuw += pulled_texture.at(x, y);
          }
        const auto sure = [](float texture) {
          const float least = std::max(texture, 1.0f);
          return least + REFINE_CELL_PRIOR * REFINE_CELL_PRIOR / least;
        };
        const float ww = sure(w), ridge = uuw * REFINE_PULL_RIDGE, uu = sure(uuw) + ridge;
        const float most = ww * uu, divisor = std::max(most - uw * uw, most * (0.5f * REFINE_PULL_RIDGE));
        cell_steps_.at(cx, cy) = step(e * uu - ue * uw, divisor);
        cell_pulls_.at(cx, cy) = step(ue * ww - e * uw, divisor);
      }
  }

  static float between_cells(const Grid<float>& cells, size_t x, size_t y) {
    const auto before = [](size_t pixel) { return (static_cast<ptrdiff_t>(2 * pixel) - (REFINE_CELL - 1)) >> 5; };
    const auto share = [](size_t pixel) {
      return static_cast<float>((static_cast<ptrdiff_t>(2 * pixel) - (REFINE_CELL - 1)) & 31) / 32.0f;
    };
    const auto cell = [&](ptrdiff_t cx, ptrdiff_t cy) {
      return cells.at(std::clamp<size_t>(static_cast<size_t>(std::max<ptrdiff_t>(cx, 0)), 0, cells.width - 1),
                      std::clamp<size_t>(static_cast<size_t>(std::max<ptrdiff_t>(cy, 0)), 0, cells.height - 1));
    };
    const auto between = [](float a, float b, float t) {
      const float first = a * (1.0f - t), second = b * t;
      return first + second;
    };
    const ptrdiff_t cx = before(x), cy = before(y);
    return between(between(cell(cx, cy), cell(cx, cy + 1), share(y)), between(cell(cx + 1, cy), cell(cx + 1, cy + 1), share(y)), share(x));
  }

  float refined(const Grid<Evidence>& evidence, size_t x, size_t y) const {
    Sums sums;
    for (size_t v = y - std::min<size_t>(y, REFINE_REACH); v < std::min(height_, y + REFINE_REACH + 1); ++v)
      for (size_t u = x - std::min<size_t>(x, REFINE_REACH); u < std::min(width_, x + REFINE_REACH + 1); ++u) sums.add(evidence.at(u, v));
    const float product = less_constant(sums.product, sums.slope, sums.difference, REFINE_WINDOW_SHARE);
    const float texture = std::max(less_constant(sums.texture, sums.slope, sums.match_slope, REFINE_WINDOW_SHARE), 0.0f);
    const int32_t q = evidence.at(x, y).q, off = sums.q - sums.count * q;
    const bool is_near = std::abs(off) < sums.count * REFINE_PHASES / 2;
    const float mean = is_near ? static_cast<float>(off) / static_cast<float>(sums.count * REFINE_PHASES) : 0.0f;
    const float smooth = static_cast<float>(q) / REFINE_PHASES + mean;
    return std::max(smooth + step(product, texture + REFINE_WINDOW_PRIOR), static_cast<float>(p_.min_disparity));
  }

  ConstImage left_, right_;
  const Grid<float>& disparity_;
  const MatchParameters& p_;
  size_t width_, height_;
  Grid<float> cell_steps_{0, 0}, cell_pulls_{0, 0};
};

}  // namespace

Grid<float> refine(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p) {
  return Refinement(left, right, disparity, p).result();
}

namespace {

uint32_t high_pass_side(uint32_t window) { return std::max(window < 13 ? 3u : 5u, 3 * window / 10 | 1); }

/// 8ths of a count above the mean of the square around.
Grid<int32_t> high_pass(ConstImage image, uint32_t bits, size_t width, size_t height, uint32_t window) {
  const auto side = static_cast<int32_t>(high_pass_side(window)), area = side * side;
  Grid<int32_t> out(width, height);
  for (size_t i = 0; i < out.data.size(); ++i) {
    const auto x = static_cast<ptrdiff_t>(i % width), y = static_cast<ptrdiff_t>(i / width);
    out.data[i] = static_cast<int32_t>(refine_count(image.at(x, y), image.element_bytes, bits));
  }
  cv::Mat sums;
  cv::boxFilter(cv::Mat(static_cast<int>(height), static_cast<int>(width), CV_32S, out.data.data()), sums, -1, {side, side}, {-1, -1},
                false, cv::BORDER_REPLICATE);
  for (size_t i = 0; i < out.data.size(); ++i) {
    const int32_t eighths = (8 * (area * out.data[i] - sums.ptr<int32_t>()[i])) >> (image.element_bytes == 1 ? 0 : 4);
    out.data[i] = std::clamp((eighths * ((65536 + area / 2) / area) + 32768) >> 16, -63, 63);
  }
  return out;
}

}  // namespace

Grid<uint8_t> detects(ConstImage left, ConstImage right, const Grid<float>& disparity, const MatchParameters& p,
                      const DetectionNoise& noise) {
  const size_t width = disparity.width, height = disparity.height;
  const uint32_t side = p.detection_window, half = side / 2;
  const auto l = high_pass(left, p.left_bits, width, height, side);
  const auto r = high_pass(right, p.right_bits, width, height, side);
  Grid<uint8_t> out(width, height, 1), bare(width, height, 0);
  for (size_t y = 0; y < height; ++y)
    for (size_t x = 0; x < width; ++x) {
      int64_t energy = 0, expected = 0, pixels = 0;
      for (size_t v = y - std::min<size_t>(y, half); v < std::min(height, y + half + 1); ++v)
        for (size_t u = x - std::min<size_t>(x, half); u < std::min(width, x + half + 1); ++u) {
          const float d = disparity.at(u, v);
          const ptrdiff_t match = static_cast<ptrdiff_t>(u) - static_cast<ptrdiff_t>(std::floor(d + 0.5f));
          if (d == p.invalid_disparity() || match < 0 || match >= static_cast<ptrdiff_t>(width)) continue;
          const int64_t both = l.at(u, v) + r.at(static_cast<size_t>(match), v);
          const uint32_t counted =
              refine_count(left.at(static_cast<ptrdiff_t>(u), static_cast<ptrdiff_t>(v)), left.element_bytes, p.left_bits);
          const int64_t count = counted >> (left.element_bytes == 1 ? 0 : 4);
          const int64_t own = noise.dark + noise.per_count * count + noise.per_count2 * count * count;
          energy += both * both;
          expected += std::clamp<int64_t>(own >> 14, noise.least, 17000);
          ++pixels;
        }
      const auto usual = static_cast<float>(expected), excess = 4.0f * static_cast<float>(energy) - 1.14f * usual;
      const float least = 4.0f * p.min_detection_sigma * p.min_detection_sigma * (usual * usual) / 2.0f;
      const bool is_found = disparity.at(x, y) != p.invalid_disparity();
      const bool is_dense = side > 15 && 32 * energy > expected && pixels > int64_t{side} * side * (47 - side) / 32;
      const bool fails = !is_dense && !(excess > 0 && excess * excess * static_cast<float>(pixels) > least);
      bare.at(x, y) = fails && (is_found || pixels > 0);
      out.at(x, y) = !is_found || !fails;
    }
  const auto reach = static_cast<int>(side / 2 + high_pass_side(side) / 2 + 1);
  cv::Mat is_bare(static_cast<int>(height), static_cast<int>(width), CV_8U, bare.data.data());
  cv::erode(is_bare, is_bare, cv::Mat::ones(3, 3, CV_8U), {-1, -1}, 1, cv::BORDER_CONSTANT, 0);
  cv::dilate(is_bare, is_bare, cv::Mat::ones(2 * reach + 1, 2 * reach + 1, CV_8U));
  for (size_t i = 0; i < out.data.size(); ++i)
    if (bare.data[i] && disparity.data[i] != p.invalid_disparity()) out.data[i] = 0;
  return out;
}

}  // namespace simsense::reference
