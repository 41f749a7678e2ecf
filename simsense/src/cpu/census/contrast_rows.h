// SPDX-License-Identifier: Apache-2.0
// Work memory for the contrast around each pixel of a row of an image, 8 or 16 bit.
#pragma once

#include "cpu/census/census.h"

namespace simsense::cpu {

class ContrastRows {
 public:
  /// width: of the image; the rows also hold the columns that a window reaches on both sides. 0: no contrast is computed.
  explicit ContrastRows(size_t width) : length_(width == 0 ? 0 : round_up(width, 64) + 2 * PaddedImage::border), storage_(3 * length_) {}
  template <class T>
  [[nodiscard]] T* low() {
    return row<T>(0);
  }
  template <class T>
  [[nodiscard]] T* high() {
    return row<T>(1);
  }
  /// For each column, the largest difference that counts as equal.
  template <class T>
  [[nodiscard]] T* insignificant() {
    return row<T>(2);
  }
  template <class T>
  [[nodiscard]] const T* insignificant() const {
    return reinterpret_cast<const T*>(storage_.data() + 2 * length_);
  }

 private:
  template <class T>
  T* row(size_t index) {
    return reinterpret_cast<T*>(storage_.data() + index * length_);
  }
  size_t length_;
  Buffer<uint16_t> storage_;
};

}  // namespace simsense::cpu
