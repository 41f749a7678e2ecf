#include "cpu/census.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/census.cpp"
#include "cpu/targets.h"
// after targets.h
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class V, class Mask>
HWY_INLINE V set_bit(V bits, Mask mask, size_t k) {
  const hn::DFromV<V> tag;
  return hn::Or(bits, hn::IfThenElseZero(mask, hn::Set(tag, static_cast<hn::TFromV<V>>(1u << k))));
}

/// The word's bits [first_bit, end_bit) of one row, into the plane that holds them.
template <class T, CensusKind kind>
void census_row(const PaddedImage& image, const CensusWindow& window, size_t y, size_t first_bit, size_t end_bit, uint8_t* plane) {
  const hn::CappedTag<T, 64 / sizeof(T)> tag;
  const hn::Rebind<uint8_t, decltype(tag)> byte_tag;
  ptrdiff_t offsets[8];
  const size_t centre_cell = window.width * window.height / 2;
  for (size_t bit = first_bit; bit < end_bit; ++bit) {
    const size_t cell = bit + (kind == CensusKind::plain && bit >= centre_cell);
    const ptrdiff_t dx = static_cast<ptrdiff_t>(cell % window.width) - static_cast<ptrdiff_t>(window.width / 2);
    const ptrdiff_t dy = static_cast<ptrdiff_t>(cell / window.width) - static_cast<ptrdiff_t>(window.height / 2);
    offsets[bit - first_bit] = dy * image.pitch() + dx;
  }
  const T* centre = image.at<T>(0, static_cast<ptrdiff_t>(y));
  for (size_t x = 0; x < image.width(); x += hn::Lanes(tag)) {
    auto bits = hn::Zero(tag);
    const auto own = hn::LoadU(tag, centre + x);
    for (size_t k = 0; k < end_bit - first_bit; ++k) {
      const auto pixel = hn::LoadU(tag, centre + x + offsets[k]);
      if constexpr (kind == CensusKind::plain) {
        bits = set_bit(bits, hn::Lt(pixel, own), k);
      } else {
        const auto mirror = hn::LoadU(tag, centre + x - offsets[k]);
        bits = set_bit(bits, hn::Eq(hn::Max(pixel, mirror), pixel), k);
      }
    }
    if constexpr (sizeof(T) == 1) {
      hn::StoreU(bits, byte_tag, plane + x);
    } else {
      hn::StoreU(hn::DemoteTo(byte_tag, hn::BitCast(hn::RebindToSigned<decltype(tag)>(), bits)), byte_tag, plane + x);
    }
  }
}

void census_bits(const PaddedImage& image, const CensusWindow& window, size_t y, size_t first_bit, size_t end_bit, uint8_t* plane) {
  const bool plain = window.kind == CensusKind::plain;
  const auto row = image.element_bytes() == 1
                       ? (plain ? census_row<uint8_t, CensusKind::plain> : census_row<uint8_t, CensusKind::center_symmetric>)
                       : (plain ? census_row<uint16_t, CensusKind::plain> : census_row<uint16_t, CensusKind::center_symmetric>);
  row(image, window, y, first_bit, end_bit, plane);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>

namespace simsense::cpu {

HWY_EXPORT(census_bits);

namespace {

size_t planes_for(size_t bit_count) {
  for (const size_t planes : {3, 4, 6})
    if (bit_count <= 8 * planes) return planes;
  return 8;
}

}  // namespace

PaddedImage::PaddedImage(size_t width, size_t height, size_t element_bytes)
    : width_(width),
      element_bytes_(element_bytes),
      pitch_(static_cast<ptrdiff_t>(round_up(width, 64)) + 2 * border),
      storage_(static_cast<size_t>(pitch_) * (height + 2 * border) * element_bytes) {}

void PaddedImage::copy_rows(ConstImage image, size_t first_row, size_t end_row) {
  const auto bytes = static_cast<ptrdiff_t>(element_bytes_);
  for (size_t y = first_row; y < end_row; ++y) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(y);
    std::copy_n(image.data + row * image.row_stride * bytes, width_ * element_bytes_,
                storage_.data() + ((row + border) * pitch_ + border) * bytes);
  }
}

CensusPlanes::CensusPlanes(size_t width, size_t height, size_t bit_count, size_t left_reach, ptrdiff_t shift)
    : width_(width),
      height_(height),
      plane_count_(planes_for(bit_count)),
      shift_(shift),
      left_pad_(round_up(std::max(left_reach, static_cast<size_t>(std::max<ptrdiff_t>(0, -shift))), 64)),
      pitch_(left_pad_ + round_up(width + static_cast<size_t>(std::max<ptrdiff_t>(0, shift)), 64) + right_reach),
      storage_(plane_count_ * height * pitch_) {}

void CensusPlanes::repeat_ends(size_t y) {
  const ptrdiff_t end = shift_ + static_cast<ptrdiff_t>(width_);
  for (size_t plane = 0; plane < plane_count_; ++plane) {
    uint8_t* columns = row(plane, y);
    std::fill(columns - left_pad_, columns + shift_, columns[shift_]);
    if (end < static_cast<ptrdiff_t>(width_)) std::fill(columns + end, columns + width_ + right_reach, columns[end - 1]);
  }
}

void census_rows(const PaddedImage& image, const CensusWindow& window, size_t first_row, size_t end_row, CensusPlanes& census) {
  const size_t cells = window.width * window.height;
  const size_t bit_count = window.kind == CensusKind::plain ? cells - 1 : (cells - 1) / 2;
  for (size_t y = first_row; y < end_row; ++y) {
    for (size_t bit = 0; bit < bit_count; bit += 8) {
      HWY_DYNAMIC_DISPATCH(census_bits)
      (image, window, y, bit, std::min(bit + 8, bit_count), census.row(bit / 8, y) + census.shift());
    }
    census.repeat_ends(y);
  }
}

}  // namespace simsense::cpu
#endif
