// SPDX-License-Identifier: Apache-2.0
#include "cpu/refine/refine.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/refine/refine.cpp"
#include "cpu/simd/targets.h"
// after targets.h
#include "cpu/refine/evidence-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// sum g e or sum g w, less what a constant makes of them.
HWY_INLINE float less_constant(int32_t sum, int32_t a, int32_t b, float share) {
  const float product = static_cast<float>(a) * static_cast<float>(b);
  return static_cast<float>(sum) - product * share;
}

/// One row of cells.
void sum_cells(const RefineImages& images, const float* filtered, size_t row, float* cells) {
  const size_t width = images.width, columns = (width + REFINE_CELL - 1) / REFINE_CELL;
  EvidenceRow evidence(width);
  std::vector<int32_t> sums[cell_sums];
  for (auto& sum : sums) sum.assign(columns * REFINE_CELL, 0);
  const size_t end = std::min(images.height, (row + 1) * REFINE_CELL);
  for (size_t y = row * REFINE_CELL; y < end; y += 2) {
    evidence.look(images, y, filtered + y * width, nullptr, nullptr);
    evidence.add_to_cells(sums, width);
  }
  for (size_t c = 0; c < columns; ++c) {
    int32_t cell[cell_sums];
    for (size_t k = 0; k < cell_sums; ++k) {
      const int32_t* first = sums[k].data() + c * REFINE_CELL;
      cell[k] = std::accumulate(first, first + REFINE_CELL, 0);
    }
    float* figures = cells + c * REFINE_CELL_FIGURES;
    const auto of = [&](size_t sum, size_t a, size_t b) { return less_constant(cell[sum], cell[a], cell[b], REFINE_CELL_SHARE); };
    figures[0] = of(sum_product, sum_slope, sum_difference);
    figures[1] = std::max(of(sum_texture, sum_slope, sum_match_slope), 0.0f);
    figures[2] = of(sum_pulled_product, sum_pulled_slope, sum_difference);
    figures[3] = of(sum_mixed_texture, sum_pulled_slope, sum_match_slope);
    figures[4] = std::max(of(sum_pulled_texture, sum_pulled_slope, sum_pulled_match_slope), 0.0f);
  }
}

/// The cells' steps, or pulls, along a row of pixels, between the middles of cells.
class CellSteps {
 public:
  CellSteps(const float* steps, size_t columns, size_t rows)
      : steps_(steps), columns_(columns), rows_(rows), line_(columns), row_((columns + 3) * REFINE_CELL) {}

  const float* row(size_t y) {
    const auto place = 2 * static_cast<ptrdiff_t>(y) - (REFINE_CELL - 1);
    const float share = static_cast<float>(place & 31) / 32.0f;
    const float* above = steps_ + cell(place >> 5, rows_) * columns_;
    const float* below = steps_ + cell((place >> 5) + 1, rows_) * columns_;
    for (size_t c = 0; c < columns_; ++c) line_[c] = above[c] * (1.0f - share) + below[c] * share;
    // from the middle of a cell on, the first of which lies half a cell before the image
    for (size_t k = 0; k <= columns_; ++k) {
      const float a = line_[cell(static_cast<ptrdiff_t>(k) - 1, columns_)], b = line_[cell(static_cast<ptrdiff_t>(k), columns_)];
      float* to = row_.data() + k * REFINE_CELL;
      for (size_t j = 0; j < REFINE_CELL; ++j) {
        const float t = static_cast<float>(2 * j + 1) / 32.0f;
        to[j] = a * (1.0f - t) + b * t;
      }
    }
    return row_.data() + REFINE_CELL / 2;
  }

 private:
  static size_t cell(ptrdiff_t c, size_t count) {
    return static_cast<size_t>(std::clamp<ptrdiff_t>(c, 0, static_cast<ptrdiff_t>(count) - 1));
  }
  const float* steps_;
  size_t columns_, rows_;
  std::vector<float> line_, row_;
};

/// The evidence of the rows of a window, which moves down the image, and its sums per column.
class Window {
 public:
  explicit Window(size_t width) : width_(width) {
    for (size_t i = 0; i < side; ++i) rows_.emplace_back(width);
    for (auto& sum : columns_) sum.assign(padded_width(width), 0);
  }
  EvidenceRow& own_row(size_t y) { return rows_[y % side]; }
  void add(size_t y) { rows_[y % side].add_to(columns_, width_, REFINE_REACH); }
  void drop(size_t y) { rows_[y % side].take_from(columns_, width_, REFINE_REACH); }
  const EvidenceRow& row(size_t y) const { return rows_[y % side]; }

  /// Over the columns of a window, from the one at x - reach on.
  HWY_INLINE hn::Vec<Ints> sum(size_t which, size_t x) const {
    const Ints ints;
    const int32_t* first = columns_[which].data() + x;  // the padding is as wide as the reach
    auto total = hn::LoadU(ints, first);
    for (size_t k = 1; k < side; ++k) total = hn::Add(total, hn::LoadU(ints, first + k));
    return total;
  }

 private:
  static constexpr size_t side = 2 * REFINE_REACH + 1;
  size_t width_;
  std::vector<EvidenceRow> rows_;
  std::vector<int32_t> columns_[window_sums];
};

HWY_INLINE hn::Vec<Floats> less_constant(hn::Vec<Ints> sum, hn::Vec<Ints> a, hn::Vec<Ints> b) {
  const Floats floats;
  const auto product = hn::Mul(hn::ConvertTo(floats, a), hn::ConvertTo(floats, b));
  return hn::Sub(hn::ConvertTo(floats, sum), hn::Mul(product, hn::Set(floats, REFINE_WINDOW_SHARE)));
}

void refine_row(const Window& window, size_t y, size_t width, float least, const float* filtered, float* refined) {
  const Ints ints;
  const Floats floats;
  const EvidenceRow& own = window.row(y);
  for (size_t x = 0; x < width; x += hn::Lanes(ints)) {
    const auto slope = window.sum(sum_slope, x);
    const auto product = less_constant(window.sum(sum_product, x), slope, window.sum(sum_difference, x));
    const auto constant_free = less_constant(window.sum(sum_texture, x), slope, window.sum(sum_match_slope, x));
    const auto texture = hn::Add(hn::Max(constant_free, hn::Zero(floats)), hn::Set(floats, REFINE_WINDOW_PRIOR));
    const auto most = hn::Set(floats, REFINE_LARGEST_STEP);
    const auto step = hn::Min(hn::Max(hn::Div(product, hn::Mul(hn::Set(floats, 6.0f), texture)), hn::Neg(most)), most);
    const auto count = window.sum(sum_count, x), q = own.disparity(x);
    const auto off = hn::Sub(window.sum(sum_disparity, x), hn::Mul(count, q));
    const auto is_near = hn::Lt(hn::Abs(off), hn::Mul(count, hn::Set(ints, REFINE_PHASES / 2)));
    const auto divisor = hn::Max(hn::Mul(count, hn::Set(ints, REFINE_PHASES)), hn::Set(ints, 1));
    const auto mean =
        hn::IfThenElseZero(hn::RebindMask(floats, is_near), hn::Div(hn::ConvertTo(floats, off), hn::ConvertTo(floats, divisor)));
    const auto smooth = hn::Add(hn::Mul(hn::ConvertTo(floats, q), hn::Set(floats, 1.0f / REFINE_PHASES)), mean);
    const auto found = hn::Max(hn::Add(smooth, step), hn::Set(floats, least));
    const auto counts = hn::RebindMask(floats, hn::Ne(own.counts(x), hn::Zero(ints)));
    HWY_ALIGN float result[hn::MaxLanes(floats)];
    hn::Store(hn::IfThenElse(counts, found, hn::LoadU(floats, filtered + x)), floats, result);
    std::copy_n(result, std::min(hn::Lanes(floats), width - x), refined + x);
  }
}

void refine_band(const RefineImages& images, const float* filtered, const float* steps, const float* pulls, size_t begin, size_t end,
                 float* refined) {
  const size_t width = images.width, columns = (width + REFINE_CELL - 1) / REFINE_CELL,
               rows = (images.height + REFINE_CELL - 1) / REFINE_CELL;
  CellSteps moved(steps, columns, rows), pulled(pulls, columns, rows);
  Window window(width);
  const size_t first = begin - std::min<size_t>(begin, REFINE_REACH), last = std::min(images.height, end + REFINE_REACH);
  size_t next = first;
  for (size_t y = begin; y < end; ++y) {
    if (y >= first + REFINE_REACH + 1) window.drop(y - REFINE_REACH - 1);
    for (; next < std::min(last, y + REFINE_REACH + 1); ++next) {
      window.own_row(next).look(images, next, filtered + next * width, moved.row(next), pulled.row(next));
      window.add(next);
    }
    refine_row(window, y, width, images.least_disparity, filtered + y * width, refined + y * width);
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <tuple>

namespace simsense::cpu {
namespace {

HWY_EXPORT(sum_cells);
HWY_EXPORT(refine_band);

float sure_of(float texture) {
  const float least = std::max(texture, 1.0f);
  return least + REFINE_CELL_PRIOR * REFINE_CELL_PRIOR / least;
}

float step_of(float product, float texture) { return std::clamp(product / (6.0f * texture), -REFINE_LARGEST_STEP, REFINE_LARGEST_STEP); }

/// Step and pull of a cell, from it and those around.
std::pair<float, float> cell_step(const std::vector<float>& cells, size_t columns, size_t rows, size_t cx, size_t cy) {
  float sums[REFINE_CELL_FIGURES] = {};
  for (size_t y = cy - (cy > 0); y < std::min(rows, cy + 2); ++y)
    for (size_t x = cx - (cx > 0); x < std::min(columns, cx + 2); ++x)
      for (size_t k = 0; k < REFINE_CELL_FIGURES; ++k) sums[k] += cells[REFINE_CELL_FIGURES * (y * columns + x) + k];
  const auto [product, texture, pull_product, mixed, pull_texture] = sums;
  const float step_sure = sure_of(texture), pull_sure = sure_of(pull_texture) + pull_texture * REFINE_PULL_RIDGE;
  const float most = step_sure * pull_sure, divisor = std::max(most - mixed * mixed, most * (0.5f * REFINE_PULL_RIDGE));
  return {step_of(product * pull_sure - pull_product * mixed, divisor), step_of(pull_product * step_sure - product * mixed, divisor)};
}

}  // namespace

void Refinement::apply(const MatchParameters& p, ConstImage left, ConstImage right, size_t width, size_t height, const float* filtered,
                       float* refined, ks::ThreadPool& workers) {
  const RefineImages images{
      left, right, width, height, {p.left_bits, p.right_bits}, p.invalid_disparity(), static_cast<float>(p.min_disparity)};
  const size_t columns = (width + REFINE_CELL - 1) / REFINE_CELL, rows = (height + REFINE_CELL - 1) / REFINE_CELL;
  cells_.resize(REFINE_CELL_FIGURES * columns * rows);
  cell_steps_.resize(columns * rows);
  cell_pulls_.resize(columns * rows);
  workers.parallel_for(rows, [&](size_t row) {
    HWY_DYNAMIC_DISPATCH(sum_cells)(images, filtered, row, cells_.data() + REFINE_CELL_FIGURES * row * columns);
  });
  for (size_t i = 0; i < columns * rows; ++i)
    std::tie(cell_steps_[i], cell_pulls_[i]) = cell_step(cells_, columns, rows, i % columns, i / columns);
  constexpr size_t band = 64;
  workers.parallel_for((height + band - 1) / band, [&](size_t i) {
    HWY_DYNAMIC_DISPATCH(refine_band)
    (images, filtered, cell_steps_.data(), cell_pulls_.data(), i * band, std::min(height, (i + 1) * band), refined);
  });
}

}  // namespace simsense::cpu
#endif
