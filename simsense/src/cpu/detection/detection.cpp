// SPDX-License-Identifier: Apache-2.0
#include "cpu/detection/detection.h"

#include <algorithm>

#include "cpu/refine/images.h"
#include "match/detection.h"

namespace simsense::cpu {
namespace {

/// Sums of count consecutive values, beginning at each of the first ones.
void sum_neighbours(const std::vector<int32_t>& values, size_t count, std::vector<int32_t>& sums) {
  int32_t sum = 0;
  for (size_t i = 0; i + 1 < count; ++i) sum += values[i];
  for (size_t x = 0; x < sums.size(); ++x) {
    sum += values[x + count - 1];
    sums[x] = sum;
    sum -= values[x];
  }
}

/// Rows of one image less the means around their pixels.
class HighPass {
 public:
  HighPass(ConstImage image, uint32_t bits, size_t width, size_t height, uint32_t mean_side)
      : image_(image),
        bits_(bits),
        width_(width),
        height_(height),
        side_(mean_side),
        row_(width),
        columns_(width + 2 * reach()),
        sums_(width) {}

  /// energy: if wanted, that of noise.
  void rows(size_t begin, size_t end, int8_t* high, uint16_t* energy, const DetectionNoise& noise) {
    std::fill(columns_.begin(), columns_.end(), 0);
    const auto first = static_cast<ptrdiff_t>(begin), far = static_cast<ptrdiff_t>(reach());
    for (ptrdiff_t v = first - far; v < first + far; ++v) add(v, 1);
    for (ptrdiff_t y = first; y < static_cast<ptrdiff_t>(end); ++y) {
      add(y + far, 1);
      sum_neighbours(columns_, side_, sums_);
      read(y);
      const int32_t part = detection_part(side_);
      const uint32_t extra = refine_extra_bits(image_.element_bytes);
      int8_t* out = high + static_cast<size_t>(y) * width_;
      for (size_t x = 0; x < width_; ++x) out[x] = static_cast<int8_t>(high_pass(row_[x], sums_[x], side_, part, extra));
      for (size_t x = 0; energy && x < width_; ++x)
        energy[static_cast<size_t>(y) * width_ + x] = static_cast<uint16_t>(noise_energy(noise, row_[x] >> extra));
      add(y - far, -1);
    }
  }

 private:
  [[nodiscard]] size_t reach() const { return side_ / 2; }
  /// The nearest row of the image.
  void read(ptrdiff_t y) {
    const ptrdiff_t inside = std::clamp<ptrdiff_t>(y, 0, static_cast<ptrdiff_t>(height_) - 1);
    read_counts(image_, static_cast<size_t>(inside), width_, bits_, row_.data());
  }
  void add(ptrdiff_t y, int32_t sign) {
    read(y);
    int32_t* inside = columns_.data() + reach();
    for (size_t x = 0; x < width_; ++x) inside[x] += sign * row_[x];
    std::fill(columns_.data(), inside, inside[0]);
    std::fill(inside + width_, inside + width_ + reach(), inside[width_ - 1]);
  }

  ConstImage image_;
  uint32_t bits_;
  size_t width_, height_;
  uint32_t side_;
  std::vector<uint16_t> row_;
  std::vector<int32_t> columns_, sums_;  // columns: sums over the rows of a square, with its reach beyond both ends
};

struct Pair {
  const int8_t *left, *right;
  const uint16_t* noise;
  const float* found;
  size_t width, height;
  float invalid;
};

constexpr size_t kinds = 3;  // those of DetectionSums

/// What the pixels of the last rows add to DetectionSums; 0 where there is no match.
class MatchedRows {
 public:
  MatchedRows(const Pair& pair, size_t count) : pair_(pair), count_(count) {
    for (auto& rows : rows_) rows.resize(count * pair.width);
  }

  void look(size_t y) {
    const size_t width = pair_.width, first = y * width;
    int32_t* to[kinds];
    for (size_t k = 0; k < kinds; ++k) to[k] = row(k, y);
    for (size_t x = 0; x < width; ++x) {
      const float disparity = pair_.found[first + x];
      const int32_t column = matched_column(static_cast<int32_t>(x), disparity);
      const bool counts = disparity != pair_.invalid && column >= 0 && column < static_cast<int32_t>(width);
      const int32_t both = counts ? pair_.left[first + x] + pair_.right[first + static_cast<size_t>(column)] : 0;
      to[0][x] = both * both;
      to[1][x] = counts ? pair_.noise[first + x] : 0;
      to[2][x] = counts ? 1 : 0;
    }
  }
  int32_t* row(size_t kind, size_t y) { return rows_[kind].data() + y % count_ * pair_.width; }
  [[nodiscard]] size_t width() const { return pair_.width; }

 private:
  const Pair& pair_;
  size_t count_;
  std::vector<int32_t> rows_[kinds];
};

/// The sums of a window that moves down the image.
class Window {
 public:
  Window(MatchedRows& rows, size_t side, size_t begin)
      : rows_(rows), side_(side), first_(begin - std::min(begin, side / 2)), next_(first_) {
    for (size_t k = 0; k < kinds; ++k) columns_[k].resize(rows.width() + side - 1), sums_[k].resize(rows.width());
  }

  /// Moves to row y from the one before; rows up to `end` have been looked at.
  void move_to(size_t y, size_t end) {
    const size_t reach = side_ / 2;
    if (y > first_ + reach) accumulate(y - reach - 1, -1);
    for (; next_ < std::min(end, y + reach + 1); ++next_) accumulate(next_, 1);
    for (size_t k = 0; k < kinds; ++k) sum_neighbours(columns_[k], side_, sums_[k]);
  }
  [[nodiscard]] DetectionSums at(size_t x) const { return {sums_[0][x], sums_[1][x], sums_[2][x]}; }

 private:
  void accumulate(size_t y, int32_t sign) {
    for (size_t k = 0; k < kinds; ++k) {
      const int32_t* from = rows_.row(k, y);
      int32_t* at = columns_[k].data() + side_ / 2;
      for (size_t x = 0; x < rows_.width(); ++x) at[x] += sign * from[x];
    }
  }

  MatchedRows& rows_;
  size_t side_, first_, next_;
  std::vector<int32_t> columns_[kinds], sums_[kinds];  // over the rows of a window, with its reach beyond both ends; over all of it
};

/// bare: [height][width], 1 where the window fails, not where it has no disparities at all.
void check_band(const Pair& pair, const MatchParameters& p, size_t begin, size_t end, const MatchMaps& maps, uint8_t* bare) {
  const uint32_t side = p.detection_side();
  const size_t reach = side / 2;
  MatchedRows rows(pair, side + 1);  // one leaves the window as another comes
  Window window(rows, side, begin);
  size_t next = begin - std::min(begin, reach);
  for (size_t y = begin; y < end; ++y) {
    for (; next < std::min(pair.height, y + reach + 1); ++next) rows.look(next);
    window.move_to(y, next);
    for (size_t x = 0; x < pair.width; ++x) {
      const size_t at = y * pair.width + x;
      const bool is_found = pair.found[at] != pair.invalid;
      const DetectionSums sums = window.at(x);
      const bool fails = !detects(sums, p.min_detection_sigma, detection_most_matched(side));
      bare[at] = fails && (is_found || sums.pixels > 0) ? 1 : 0;
      if (fails && is_found) maps.reject(at, pair.invalid, MatchReason::low_texture);
    }
  }
}

/// The pixels that have 3 x 3 bare ones about one within reach, row by row.
class NearBare {
 public:
  NearBare(const uint8_t* bare, size_t width, size_t height, size_t reach)
      : bare_(bare),
        width_(width),
        height_(height),
        reach_(reach),
        line_(width + 2 * reach),
        kept_((2 * reach + 1) * width),
        counts_(width) {}

  void add(size_t y) {
    std::fill(line_.begin(), line_.end(), 0);
    if (y > 0 && y + 1 < height_)
      for (size_t x = 1; x + 1 < width_; ++x) {
        const uint8_t* at = bare_ + y * width_ + x;
        uint8_t all = 1;
        for (const uint8_t* row : {at - width_, at, at + width_}) all &= row[-1] & row[0] & row[1];
        line_[x + reach_] = all;
      }
    for (size_t seen = 1, step = 0; seen < 2 * reach_ + 1; seen += step) {
      step = std::min(seen, 2 * reach_ + 1 - seen);
      for (size_t x = 0; x + step < line_.size(); ++x) line_[x] |= line_[x + step];
    }
    uint8_t* own = kept(y);
    for (size_t x = 0; x < width_; ++x) counts_[x] += own[x] = line_[x];
  }
  void drop(size_t y) {
    for (size_t x = 0; x < width_; ++x) counts_[x] -= kept(y)[x];
  }
  [[nodiscard]] bool at(size_t x) const { return counts_[x] > 0; }

 private:
  uint8_t* kept(size_t y) { return kept_.data() + y % (2 * reach_ + 1) * width_; }

  const uint8_t* bare_;
  size_t width_, height_, reach_;
  std::vector<uint8_t> line_, kept_, counts_;  // a row with its reach beyond both ends; those of the last rows; their sums by column
};

void close_band(const Pair& pair, const uint8_t* bare, size_t reach, size_t begin, size_t end, const MatchMaps& maps) {
  NearBare near(bare, pair.width, pair.height, reach);
  const size_t first = begin - std::min(begin, reach);
  size_t next = first;
  for (size_t y = begin; y < end; ++y) {
    if (y > first + reach) near.drop(y - reach - 1);
    for (; next < std::min(pair.height, y + reach + 1); ++next) near.add(next);
    for (size_t x = 0; x < pair.width; ++x)
      if (near.at(x) && maps.disparity[y * pair.width + x] != pair.invalid)
        maps.reject(y * pair.width + x, pair.invalid, MatchReason::low_texture);
  }
}

}  // namespace

void DetectionCheck::apply(const MatchParameters& p, ConstImage left, ConstImage right, size_t width, size_t height, const float* found,
                           const DetectionNoise& noise, const MatchMaps& maps, ks::ThreadPool& workers) {
  constexpr size_t band = 64;
  const size_t bands = (height + band - 1) / band;
  const uint32_t mean_side = detection_mean_side(p.detection_side());
  for (auto& high : high_) high.resize(width * height);
  noise_energy_.resize(width * height);
  workers.parallel_for(2 * bands, [&](size_t i) {
    const size_t side = i % 2, begin = i / 2 * band;
    HighPass(side == 0 ? left : right, side == 0 ? p.left_bits : p.right_bits, width, height, mean_side)
        .rows(begin, std::min(height, begin + band), high_[side].data(), side == 0 ? noise_energy_.data() : nullptr, noise);
  });
  const Pair pair{high_[0].data(), high_[1].data(), noise_energy_.data(), found, width, height, p.invalid_disparity()};
  const auto in_bands = [&](auto check) {
    workers.parallel_for(bands, [&](size_t i) { check(i * band, std::min(height, (i + 1) * band)); });
  };
  bare_.resize(width * height);
  in_bands([&](size_t begin, size_t end) { check_band(pair, p, begin, end, maps, bare_.data()); });
  const size_t reach = detection_bare_reach(p.detection_side());
  in_bands([&](size_t begin, size_t end) { close_band(pair, bare_.data(), reach, begin, end, maps); });
}

}  // namespace simsense::cpu
