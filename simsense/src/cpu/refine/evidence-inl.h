// SPDX-License-Identifier: Apache-2.0
// The terms that a row's pixels add to the refinement's window sums. Lanes are pixels.
#if defined(SIMSENSE_CPU_EVIDENCE_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_EVIDENCE_INL_H_
#undef SIMSENSE_CPU_EVIDENCE_INL_H_
#else
#define SIMSENSE_CPU_EVIDENCE_INL_H_
#endif

#include <algorithm>
#include <cstring>
#include <numeric>
#include <vector>

#include "cpu/refine/images.h"
#include "hwy/highway.h"
#include "match/refine.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, 16>;
using Ints = hn::RebindToSigned<Floats>;

/// The sums over a window, by name.
enum WindowSum : size_t { sum_slope, sum_match_slope, sum_difference, sum_product, sum_texture, sum_count, sum_disparity, window_sums };
/// A cell's, after the first five of a window; u: the pull's shape.
enum CellSum : size_t {
  sum_pulled_slope = 5,
  sum_pulled_match_slope,
  sum_pulled_product,
  sum_mixed_texture,
  sum_pulled_texture,
  cell_sums
};

/// Length of a row of sums: a window's reach before the image, the same and one vector more behind it.
inline size_t padded_width(size_t width) { return width + 2 * REFINE_REACH + 2 * hn::MaxLanes(Ints()); }

class EvidenceRow {
 public:
  explicit EvidenceRow(size_t width)
      : right_(width + 2 * spare),
        rise_(width + spare),
        smooth_(width + spare),
        left_(width + 2 * slope_reach + spare),
        disparity_(width + spare) {
    for (auto* values : {&slope_, &match_slope_, &difference_, &counts_}) values->assign(width + spare, 0);
  }

  /// Computes the evidence of row y. disparity: of the row, px; moved and pulled: added to it if given, px, the second with the pull's
  /// shape. All are read up to a vector beyond the row.
  void look(const RefineImages& images, size_t y, const float* disparity, const float* moved, const float* pulled) {
    read_counts(images, y);
    const Ints ints;
    const Floats floats;
    const size_t width = images.width, lanes = hn::Lanes(ints);
    const auto beyond = hn::Set(ints, static_cast<int32_t>(width) - 2);
    for (size_t x = 0; x < width; x += lanes) {
      auto d = hn::LoadU(floats, disparity + x);
      const auto valid = hn::Ne(d, hn::Set(floats, images.invalid));
      if (moved) {
        const auto shape = hn::Mul(hn::ConvertTo(floats, pull_at(phase_of(d))), hn::Set(floats, REFINE_PULL_UNIT));
        d = hn::Add(hn::Add(d, hn::LoadU(floats, moved + x)), hn::Mul(hn::LoadU(floats, pulled + x), shape));
      }
      const auto q = phase_of(d);
      const auto column = hn::Iota(ints, static_cast<int32_t>(x));
      const auto place = hn::Sub(hn::ShiftLeft<5>(column), q);
      const auto at = hn::ShiftRight<5>(place);
      const auto inside = hn::And(hn::Gt(at, hn::Zero(ints)), hn::Lt(at, beyond));
      const auto counts = hn::And(hn::And(hn::RebindMask(ints, valid), inside), hn::Lt(column, hn::Set(ints, static_cast<int32_t>(width))));
      add_evidence(x, images.extra_bits(), counts, hn::And(place, hn::Set(ints, REFINE_PHASES - 1)), at, q);
    }
  }

  [[nodiscard]] HWY_INLINE hn::Vec<Ints> disparity(size_t x) const { return hn::LoadU(Ints(), disparity_.data() + x); }
  [[nodiscard]] HWY_INLINE hn::Vec<Ints> counts(size_t x) const { return hn::LoadU(Ints(), counts_.data() + x); }

  void add_to(std::vector<int32_t> (&sums)[window_sums], size_t width, size_t before) const {
    accumulate(sums, width, before, [](auto sum, auto value) { return hn::Add(sum, value); });
  }
  void add_to_cells(std::vector<int32_t> (&sums)[cell_sums], size_t width) const {
    const Ints ints;
    const auto eighth = [&](auto v) { return hn::ShiftRight<3>(hn::Add(v, hn::Set(ints, 4))); };
    for (size_t x = 0; x < width; x += hn::Lanes(ints)) {
      const auto slope = hn::LoadU(ints, slope_.data() + x), match_slope = hn::LoadU(ints, match_slope_.data() + x);
      const auto difference = hn::LoadU(ints, difference_.data() + x), shape = pull_at(disparity(x));
      const auto pulled = eighth(hn::Mul(slope, shape)), pulled_match = eighth(hn::Mul(match_slope, shape));
      const hn::Vec<Ints> values[cell_sums] = {slope,
                                               match_slope,
                                               difference,
                                               hn::Mul(slope, difference),
                                               hn::Mul(slope, match_slope),
                                               pulled,
                                               pulled_match,
                                               hn::Mul(pulled, difference),
                                               hn::Mul(pulled, match_slope),
                                               hn::Mul(pulled, pulled_match)};
      for (size_t k = 0; k < cell_sums; ++k) hn::StoreU(hn::Add(hn::LoadU(ints, sums[k].data() + x), values[k]), ints, sums[k].data() + x);
    }
  }
  void take_from(std::vector<int32_t> (&sums)[window_sums], size_t width, size_t before) const {
    accumulate(sums, width, before, [](auto sum, auto value) { return hn::Sub(sum, value); });
  }

 private:
  static constexpr size_t spare = 2 * hn::MaxLanes(Ints()), slope_reach = 4;

  static HWY_INLINE hn::Vec<Ints> phase_of(hn::Vec<Floats> disparity) {
    const Floats floats;
    const auto phases = hn::Mul(disparity, hn::Set(floats, static_cast<float>(REFINE_PHASES)));
    return hn::ConvertTo(Ints(), hn::Floor(hn::Add(phases, hn::Set(floats, 0.5f))));
  }
  /// The shape of the pull to whole pixels, by a disparity in 32nds of a pixel.
  static HWY_INLINE hn::Vec<Ints> pull_at(hn::Vec<Ints> q) {
    const Ints ints;
    const auto half = hn::Set(ints, REFINE_PHASES / 2);
    const auto off = hn::Sub(hn::And(q, hn::Set(ints, REFINE_PHASES - 1)), half), far = hn::Abs(off);
    const auto size = hn::Min(hn::Mul(hn::Set(ints, 5), hn::Sub(half, far)), far);
    return hn::IfThenElse(hn::Lt(off, hn::Zero(ints)), size, hn::Neg(size));
  }

  void read_counts(const RefineImages& images, size_t y) {
    const size_t width = images.width;
    images.read(1, y, right_.data());
    uint16_t* left = left_.data() + slope_reach;
    images.read(0, y, left);
    std::fill_n(left_.data(), slope_reach, left[0]);
    std::fill_n(left + width, slope_reach, left[width - 1]);
    const uint32_t extra = images.extra_bits();
    const int32_t half = 1 << extra >> 1;
    for (size_t x = 0; x < width; ++x) {
      const uint16_t* c = left + x;
      rise_[x] = (c[2] - c[-2] + 2 * (c[1] - c[-1]) - (c[4] - c[-4]) + half) >> extra;
      smooth_[x] = (c[-1] + 4 * c[0] + c[1]) * 32768;
    }
  }

  /// Adds the evidence of pixels from column x on. f: 32nds of a pixel from column `at` of the right image on.
  HWY_INLINE void add_evidence(size_t x, uint32_t extra, hn::Mask<Ints> counts, hn::Vec<Ints> f, hn::Vec<Ints> at, hn::Vec<Ints> q) {
    const Ints ints;
    HWY_ALIGN int32_t first[hn::MaxLanes(ints)];
    HWY_ALIGN int32_t taps[2 * hn::MaxLanes(ints)];  // four counts of 16 bits per pixel
    hn::Store(hn::IfThenElseZero(counts, hn::Sub(at, hn::Set(ints, 1))), ints, first);
    for (size_t lane = 0; lane < hn::Lanes(ints); ++lane) std::memcpy(taps + 2 * lane, right_.data() + first[lane], 8);
    hn::Vec<Ints> low, high;
    hn::LoadInterleaved2(ints, taps, low, high);
    const auto mask = hn::Set(ints, 0xffff);
    const auto c0 = hn::And(low, mask), c1 = hn::And(hn::ShiftRight<16>(low), mask);
    const auto c2 = hn::And(high, mask), c3 = hn::And(hn::ShiftRight<16>(high), mask);
    const auto u = hn::Sub(hn::Set(ints, REFINE_PHASES), f), f2 = hn::Mul(f, f), u2 = hn::Mul(u, u);
    const auto f3 = hn::Mul(f2, f), u3 = hn::Mul(u2, u), three = hn::Set(ints, 3), top = hn::Set(ints, 131072);
    const auto w1 = hn::Add(hn::Sub(hn::Mul(three, f3), hn::Mul(hn::Set(ints, 192), f2)), top);
    const auto w2 = hn::Add(hn::Sub(hn::Mul(three, u3), hn::Mul(hn::Set(ints, 192), u2)), top);
    const auto value = hn::Add(hn::Add(hn::Mul(u3, c0), hn::Mul(w1, c1)), hn::Add(hn::Mul(w2, c2), hn::Mul(f3, c3)));
    const auto s1 = hn::Sub(hn::Mul(three, f2), hn::ShiftLeft<7>(f)), s2 = hn::Sub(hn::ShiftLeft<7>(u), hn::Mul(three, u2));
    const auto slope = hn::Add(hn::Sub(hn::Mul(f2, c3), hn::Mul(u2, c0)), hn::Add(hn::Mul(s1, c1), hn::Mul(s2, c2)));
    const auto rounded = [&](hn::Vec<Ints> v, uint32_t bits) {
      return hn::ShiftRightSame(hn::Add(v, hn::Set(ints, 1 << (bits - 1))), static_cast<int>(bits));
    };
    const auto most = hn::Set(ints, REFINE_LARGEST_DIFFERENCE);
    const auto difference = rounded(hn::Sub(value, hn::LoadU(ints, smooth_.data() + x)), 12 + extra);
    const auto bounded = hn::Min(hn::Max(difference, hn::Neg(most)), most);
    hn::StoreU(hn::IfThenElseZero(counts, hn::LoadU(ints, rise_.data() + x)), ints, slope_.data() + x);
    hn::StoreU(hn::IfThenElseZero(counts, rounded(slope, 8 + extra)), ints, match_slope_.data() + x);
    hn::StoreU(hn::IfThenElseZero(counts, bounded), ints, difference_.data() + x);
    hn::StoreU(hn::IfThenElseZero(counts, hn::Set(ints, 1)), ints, counts_.data() + x);
    hn::StoreU(hn::IfThenElseZero(counts, q), ints, disparity_.data() + x);
  }

  template <class Join>
  HWY_INLINE void accumulate(std::vector<int32_t> (&sums)[window_sums], size_t width, size_t before, Join join) const {
    const Ints ints;
    for (size_t x = 0; x < width; x += hn::Lanes(ints)) {
      const auto slope = hn::LoadU(ints, slope_.data() + x), match_slope = hn::LoadU(ints, match_slope_.data() + x);
      const auto difference = hn::LoadU(ints, difference_.data() + x);
      const hn::Vec<Ints> values[window_sums] = {slope,
                                                 match_slope,
                                                 difference,
                                                 hn::Mul(slope, difference),
                                                 hn::Mul(slope, match_slope),
                                                 hn::LoadU(ints, counts_.data() + x),
                                                 hn::LoadU(ints, disparity_.data() + x)};
      for (size_t k = 0; k < window_sums; ++k) {
        int32_t* sum = sums[k].data() + before + x;
        hn::StoreU(join(hn::LoadU(ints, sum), values[k]), ints, sum);
      }
    }
  }

  std::vector<uint16_t> right_;
  std::vector<int32_t> rise_, smooth_;
  std::vector<uint16_t> left_;
  std::vector<int32_t> slope_, match_slope_, difference_, counts_, disparity_;
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
