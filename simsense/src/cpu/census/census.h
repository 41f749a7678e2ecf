// SPDX-License-Identifier: Apache-2.0
// Census into byte planes: plane k holds bits 8k .. 8k+7 of every pixel, so that one vector of bytes is one vector of pixels.
#pragma once

#include "cpu/simd/buffer.h"
#include "match/matcher.h"

namespace simsense::cpu {

/// An image with a border wide enough for any census window, filled with zeros or with the nearest pixel.
class PaddedImage {
 public:
  /// element_bytes: 1 or 2 per pixel. repeats_edge: fills the border with the nearest pixel.
  PaddedImage(size_t width, size_t height, size_t element_bytes = 1, bool repeats_edge = false);
  void copy_rows(ConstImage image, size_t first_row, size_t end_row);
  [[nodiscard]] size_t element_bytes() const { return element_bytes_; }
  /// Address of pixel (x, y), which may lie up to `border` outside the image. T: uint8_t or uint16_t, by element_bytes.
  template <class T>
  [[nodiscard]] const T* at(ptrdiff_t x, ptrdiff_t y) const {
    return reinterpret_cast<const T*>(storage_.data()) + (y + border) * pitch_ + border + x;
  }
  [[nodiscard]] ptrdiff_t pitch() const { return pitch_; }  // elements
  [[nodiscard]] size_t width() const { return width_; }
  static constexpr ptrdiff_t border = 64;

 private:
  template <class T>
  void repeat_edge(ptrdiff_t y);

  size_t width_, height_, element_bytes_;
  bool repeats_edge_;
  ptrdiff_t pitch_;
  Buffer<uint8_t> storage_;
};

/// The census words of an image, moved `shift` columns to the right. To the left its first column repeats, to the right its last.
class CensusPlanes {
 public:
  /// left_reach: how many columns left of column 0 may be read.
  CensusPlanes(size_t width, size_t height, size_t bit_count, size_t left_reach, ptrdiff_t shift = 0);
  /// Byte planes of a word: 3, 4, 6 or 8; planes without bits are zero.
  [[nodiscard]] size_t plane_count() const { return plane_count_; }
  [[nodiscard]] ptrdiff_t shift() const { return shift_; }
  [[nodiscard]] uint8_t* row(size_t plane, size_t y) { return storage_.data() + (plane * height_ + y) * pitch_ + left_pad_; }
  [[nodiscard]] const uint8_t* row(size_t plane, size_t y) const { return storage_.data() + (plane * height_ + y) * pitch_ + left_pad_; }
  /// Repeats the first and last word of row y to both sides; the row begins at column `shift`.
  void repeat_ends(size_t y);
  /// How far behind the width a vector may be read.
  static constexpr size_t right_reach = 512;

 private:
  size_t width_, height_, plane_count_;
  ptrdiff_t shift_;
  size_t left_pad_, pitch_;
  Buffer<uint8_t> storage_;
};

/// Computes the census of rows [first_row, end_row).
void census_rows(const PaddedImage& image, const MatchParameters& parameters, size_t first_row, size_t end_row, CensusPlanes& census);

}  // namespace simsense::cpu
