// SPDX-License-Identifier: Apache-2.0
#include "cpu/census/census.h"

#include <algorithm>

#include "cpu/census/contrast_rows.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/census/census.cpp"
#include "cpu/simd/targets.h"
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

/// Lowest and highest of `count` values that lie `step` apart, for `length` places.
template <class T>
void extremes(const T* low_in, const T* high_in, size_t count, ptrdiff_t step, size_t length, T* low_out, T* high_out) {
  const hn::CappedTag<T, 64 / sizeof(T)> tag;
  for (size_t x = 0; x < length; x += hn::Lanes(tag)) {
    auto low = hn::LoadU(tag, low_in + x), high = hn::LoadU(tag, high_in + x);
    for (size_t k = 1; k < count; ++k) {
      const ptrdiff_t at = static_cast<ptrdiff_t>(x) + static_cast<ptrdiff_t>(k) * step;
      low = hn::Min(low, hn::LoadU(tag, low_in + at));
      high = hn::Max(high, hn::LoadU(tag, high_in + at));
    }
    hn::StoreU(low, tag, low_out + x);
    hn::StoreU(high, tag, high_out + x);
  }
}

/// The largest difference that counts as none, per pixel of a row.
template <class T>
void insignificant_row(const PaddedImage& image, const MatchParameters& p, size_t y, ContrastRows& rows) {
  constexpr auto margin = static_cast<ptrdiff_t>(MatchParameters::contrast_margin);
  const ptrdiff_t left = static_cast<ptrdiff_t>(p.census_width / 2) + margin, above = static_cast<ptrdiff_t>(p.census_height / 2) + margin;
  const size_t columns = 2 * static_cast<size_t>(left) + 1, lines = 2 * static_cast<size_t>(above) + 1;
  T *low = rows.low<T>(), *high = rows.high<T>(), *needed = rows.insignificant<T>();
  const T* first = image.at<T>(-left, static_cast<ptrdiff_t>(y) - above);
  extremes(first, first, lines, image.pitch(), image.width() + columns - 1, low, high);
  extremes(low, high, columns, 1, image.width(), needed, high);
  // Copies: a store to bytes may be one to the parameters, for all that the compiler knows, and would keep the loop from lanes.
  const size_t width = image.width();
  const uint32_t contrast = p.census_contrast_256ths;
  const auto noise = static_cast<T>(p.census_noise_dn);
  for (size_t x = 0; x < width; ++x)
    needed[x] = std::max(static_cast<T>(static_cast<uint32_t>(high[x] - needed[x]) * contrast >> 8), noise);
}

/// The word's bits [first_bit, end_bit) of one row, into the plane that holds them.
template <class T, CensusKind kind, bool with_contrast>
void census_row(const PaddedImage& image, const MatchParameters& p, const ContrastRows& contrast, size_t y, size_t first_bit,
                size_t end_bit, uint8_t* plane) {
  const hn::CappedTag<T, 64 / sizeof(T)> tag;
  const hn::Rebind<uint8_t, decltype(tag)> byte_tag;
  ptrdiff_t offsets[8];
  const size_t centre_cell = size_t{p.census_width} * p.census_height / 2;
  for (size_t bit = first_bit; bit < end_bit; ++bit) {
    const size_t cell = bit + (kind == CensusKind::plain && bit >= centre_cell);
    const ptrdiff_t dx = static_cast<ptrdiff_t>(cell % p.census_width) - static_cast<ptrdiff_t>(p.census_width / 2);
    const ptrdiff_t dy = static_cast<ptrdiff_t>(cell / p.census_width) - static_cast<ptrdiff_t>(p.census_height / 2);
    const bool takes_turn = with_contrast && kind == CensusKind::center_symmetric && bit % 2 == 1;
    offsets[bit - first_bit] = (dy * image.pitch() + dx) * (takes_turn ? -1 : 1);
  }
  const T* centre = image.at<T>(0, static_cast<ptrdiff_t>(y));
  for (size_t x = 0; x < image.width(); x += hn::Lanes(tag)) {
    auto bits = hn::Zero(tag);
    const auto own = hn::LoadU(tag, centre + x);
    const auto insignificant = with_contrast ? hn::LoadU(tag, contrast.insignificant<T>() + x) : hn::Zero(tag);
    for (size_t k = 0; k < end_bit - first_bit; ++k) {
      const auto pixel = hn::LoadU(tag, centre + x + offsets[k]);
      const auto mirror = hn::LoadU(tag, centre + x - offsets[k]);
      if constexpr (with_contrast) {
        const auto above = kind == CensusKind::plain ? hn::SaturatedSub(own, pixel) : hn::SaturatedSub(pixel, mirror);
        bits = set_bit(bits, hn::Gt(above, insignificant), k);
      } else if constexpr (kind == CensusKind::plain) {
        bits = set_bit(bits, hn::Lt(pixel, own), k);
      } else {
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

template <class T, CensusKind kind>
constexpr auto row_of(bool with_contrast) {
  return with_contrast ? census_row<T, kind, true> : census_row<T, kind, false>;
}

void census_bits(const PaddedImage& image, const MatchParameters& p, const ContrastRows& contrast, size_t y, size_t first_bit,
                 size_t end_bit, uint8_t* plane) {
  const bool plain = p.census_kind == CensusKind::plain, with_contrast = p.census_contrast_256ths > 0;
  const auto row =
      image.element_bytes() == 1
          ? (plain ? row_of<uint8_t, CensusKind::plain>(with_contrast) : row_of<uint8_t, CensusKind::center_symmetric>(with_contrast))
          : (plain ? row_of<uint16_t, CensusKind::plain>(with_contrast) : row_of<uint16_t, CensusKind::center_symmetric>(with_contrast));
  row(image, p, contrast, y, first_bit, end_bit, plane);
}

void find_insignificant(const PaddedImage& image, const MatchParameters& p, size_t y, ContrastRows& rows) {
  (image.element_bytes() == 1 ? insignificant_row<uint8_t> : insignificant_row<uint16_t>)(image, p, y, rows);
}

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE

namespace simsense::cpu {

HWY_EXPORT(census_bits);
HWY_EXPORT(find_insignificant);

namespace {

size_t planes_for(size_t bit_count) {
  for (const size_t planes : {3, 4, 6})
    if (bit_count <= 8 * planes) return planes;
  return 8;
}

}  // namespace

PaddedImage::PaddedImage(size_t width, size_t height, size_t element_bytes, bool repeats_edge)
    : width_(width),
      height_(height),
      element_bytes_(element_bytes),
      repeats_edge_(repeats_edge),
      pitch_(static_cast<ptrdiff_t>(round_up(width, 64)) + 2 * border),
      storage_(static_cast<size_t>(pitch_) * (height + 2 * border) * element_bytes) {}

void PaddedImage::copy_rows(ConstImage image, size_t first_row, size_t end_row) {
  const auto bytes = static_cast<ptrdiff_t>(element_bytes_);
  for (size_t y = first_row; y < end_row; ++y) {
    const ptrdiff_t row = static_cast<ptrdiff_t>(y);
    std::copy_n(image.data + row * image.row_stride * bytes, width_ * element_bytes_,
                storage_.data() + ((row + border) * pitch_ + border) * bytes);
    if (repeats_edge_) element_bytes_ == 1 ? repeat_edge<uint8_t>(row) : repeat_edge<uint16_t>(row);
  }
}

template <class T>
void PaddedImage::repeat_edge(ptrdiff_t y) {
  const auto row = [&](ptrdiff_t at) { return reinterpret_cast<T*>(storage_.data()) + (at + border) * pitch_; };
  T* first = row(y) + border;
  const auto width = static_cast<ptrdiff_t>(width_), last_y = static_cast<ptrdiff_t>(height_) - 1;
  std::fill(first - border, first, first[0]);
  std::fill(first + width, row(y) + pitch_, first[width - 1]);
  for (ptrdiff_t k = 1; k <= border && y == 0; ++k) std::copy_n(row(0), pitch_, row(-k));
  for (ptrdiff_t k = 1; k <= border && y == last_y; ++k) std::copy_n(row(last_y), pitch_, row(last_y + k));
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

void census_rows(const PaddedImage& image, const MatchParameters& p, size_t first_row, size_t end_row, CensusPlanes& census) {
  const size_t cells = size_t{p.census_width} * p.census_height;
  const size_t bit_count = p.census_kind == CensusKind::plain ? cells - 1 : (cells - 1) / 2;
  ContrastRows contrast(p.census_contrast_256ths > 0 ? image.width() : 0);
  for (size_t y = first_row; y < end_row; ++y) {
    if (p.census_contrast_256ths > 0) HWY_DYNAMIC_DISPATCH(find_insignificant)(image, p, y, contrast);
    for (size_t bit = 0; bit < bit_count; bit += 8) {
      HWY_DYNAMIC_DISPATCH(census_bits)
      (image, p, contrast, y, bit, std::min(bit + 8, bit_count), census.row(bit / 8, y) + census.shift());
    }
    census.repeat_ends(y);
  }
}

}  // namespace simsense::cpu
#endif
