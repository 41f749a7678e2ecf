#include "cpu/census.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/census.cpp"
#include "cpu/targets.h"
// after targets.h
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Bits [first_bit, end_bit) of one row, into the plane that holds them.
void census_row(const PaddedImage& image, size_t window_width, size_t window_height, size_t y, size_t first_bit, size_t end_bit,
                uint8_t* plane) {
  const hn::CappedTag<uint8_t, 64> tag;
  const ptrdiff_t half_width = static_cast<ptrdiff_t>(window_width / 2), half_height = static_cast<ptrdiff_t>(window_height / 2);
  ptrdiff_t offsets[8];
  for (size_t bit = first_bit; bit < end_bit; ++bit) {
    const ptrdiff_t dx = static_cast<ptrdiff_t>(bit % window_width) - half_width;
    offsets[bit - first_bit] = (static_cast<ptrdiff_t>(bit / window_width) - half_height) * image.pitch() + dx;
  }
  const uint8_t* centre = image.at(0, static_cast<ptrdiff_t>(y));
  for (size_t x = 0; x < image.width(); x += hn::Lanes(tag)) {
    auto bits = hn::Zero(tag);
    for (size_t k = 0; k < end_bit - first_bit; ++k) {
      const auto pixel = hn::LoadU(tag, centre + x + offsets[k]);
      const auto mirror = hn::LoadU(tag, centre + x - offsets[k]);
      const auto not_less = hn::Eq(hn::Max(pixel, mirror), pixel);
      bits = hn::Or(bits, hn::IfThenElseZero(not_less, hn::Set(tag, static_cast<uint8_t>(1u << k))));
    }
    hn::StoreU(bits, tag, plane + x);
  }
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>

namespace simsense::cpu {

HWY_EXPORT(census_row);

PaddedImage::PaddedImage(size_t width, size_t height)
    : width_(width),
      pitch_(static_cast<ptrdiff_t>(round_up(width, 64) + 2 * border)),
      storage_(static_cast<size_t>(pitch_) * (height + 2 * border)),
      origin_(storage_.data() + static_cast<ptrdiff_t>(border) * pitch_ + border) {}

void PaddedImage::copy_rows(ConstImage image, size_t first_row, size_t end_row) {
  for (size_t y = first_row; y < end_row; ++y) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(y);
    std::copy_n(image.data + row * image.row_stride, width_, origin_ + row * pitch_);
  }
}

CensusPlanes::CensusPlanes(size_t width, size_t height, size_t bit_count, size_t left_reach)
    : height_(height),
      plane_count_(bit_count > 24 ? 4 : 3),
      left_pad_(round_up(left_reach, 64)),
      pitch_(left_pad_ + round_up(width, 64) + right_reach),
      storage_(plane_count_ * height * pitch_) {}

void CensusPlanes::repeat_first_column(size_t y) {
  for (size_t plane = 0; plane < plane_count_; ++plane) std::fill_n(row(plane, y) - left_pad_, left_pad_, row(plane, y)[0]);
}

void census_rows(const PaddedImage& image, size_t window_width, size_t window_height, size_t first_row, size_t end_row,
                 CensusPlanes& census) {
  const size_t bit_count = (window_width * window_height - 1) / 2;
  for (size_t y = first_row; y < end_row; ++y) {
    for (size_t bit = 0; bit < bit_count; bit += 8) {
      HWY_DYNAMIC_DISPATCH(census_row)(image, window_width, window_height, y, bit, std::min(bit + 8, bit_count), census.row(bit / 8, y));
    }
    census.repeat_first_column(y);
  }
}

}  // namespace simsense::cpu
#endif
