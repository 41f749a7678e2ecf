// Center-symmetric census into byte planes: plane k holds bits 8k .. 8k+7 of every pixel, so that one vector of bytes is one vector of
// pixels.
#pragma once

#include "cpu/buffer.h"
#include "matcher.h"

namespace simsense::cpu {

/// An image with a border of zeros wide enough for any census window.
class PaddedImage {
 public:
  PaddedImage(size_t width, size_t height);
  void copy_rows(ConstImage image, size_t first_row, size_t end_row);
  /// x, y may reach `border` outside the image.
  [[nodiscard]] const uint8_t* at(ptrdiff_t x, ptrdiff_t y) const { return origin_ + y * pitch_ + x; }
  [[nodiscard]] ptrdiff_t pitch() const { return pitch_; }
  [[nodiscard]] size_t width() const { return width_; }
  static constexpr size_t border = 64;

 private:
  size_t width_;
  ptrdiff_t pitch_;
  Buffer<uint8_t> storage_;
  uint8_t* origin_;
};

/// Census of an image. To the left of column 0 that column is repeated `left_reach` times; to the right of the image there is readable
/// memory.
class CensusPlanes {
 public:
  CensusPlanes(size_t width, size_t height, size_t bit_count, size_t left_reach);
  /// 3 or 4; planes without bits are zero.
  [[nodiscard]] size_t plane_count() const { return plane_count_; }
  [[nodiscard]] uint8_t* row(size_t plane, size_t y) { return storage_.data() + (plane * height_ + y) * pitch_ + left_pad_; }
  [[nodiscard]] const uint8_t* row(size_t plane, size_t y) const { return storage_.data() + (plane * height_ + y) * pitch_ + left_pad_; }
  void repeat_first_column(size_t y);
  /// How far behind the width a vector may be read.
  static constexpr size_t right_reach = 512;

 private:
  size_t height_, plane_count_, left_pad_, pitch_;
  Buffer<uint8_t> storage_;
};

/// Census of rows [first_row, end_row).
void census_rows(const PaddedImage& image, size_t window_width, size_t window_height, size_t first_row, size_t end_row,
                 CensusPlanes& census);

}  // namespace simsense::cpu
