// SPDX-License-Identifier: Apache-2.0
// One step of a semi-global path (Hirschmüller 2008, eq. 13) for a vector of paths side by side: lanes are pixels, d - 1 and d + 1 are
// neighbouring registers, the minimum over d is a running one. Nothing is shuffled.
//
// A step works with m = L - C: what the path adds to the pixel's own cost, at most p2. It needs fewer bits than L.
#if defined(SIMSENSE_CPU_PATH_STEP_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef SIMSENSE_CPU_PATH_STEP_INL_H_
#undef SIMSENSE_CPU_PATH_STEP_INL_H_
#else
#define SIMSENSE_CPU_PATH_STEP_INL_H_
#endif

#include <algorithm>

#include "cpu/sgm/penalty_maps.h"
#include "cpu/simd/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

/// P1 of all pixels, and P2 of a vector of them.
template <class T>
struct Penalties {
  T p1, p2, area;
  const PenaltyMaps* maps;

  [[nodiscard]] bool uniform() const { return maps->uniform(); }
  /// P2 of the columns from x on, one per lane.
  HWY_INLINE Vector<T> columns(PathDirection direction, ptrdiff_t x, size_t y) const {
    return uniform() ? hn::Set(Lanes<T>(), p2) : scaled(maps->row(direction, y) + x);
  }
  /// P2 of the pixels whose penalties lie side by side in memory.
  HWY_INLINE Vector<T> scaled(const uint8_t* per_pixel) const {
    const Lanes<T> tag;
    if constexpr (sizeof(T) == 1) {
      return hn::LoadU(tag, per_pixel);
    } else {
      return hn::Mul(hn::PromoteTo(tag, hn::LoadU(hn::Rebind<uint8_t, Lanes<T>>(), per_pixel)), hn::Set(tag, area));
    }
  }
};

/// Elements of a path's state: the last pixel's L for each d, then `unreachable` (the neighbour of d = D - 1), then the minimum of L over
/// d.
template <class T>
constexpr size_t path_state_size(size_t disparities) {
  return (disparities + 2) * lane_count<T>;
}

/// Sets a path's state to zero, so that L = C at the first pixel.
template <class T>
void enter_image(size_t disparities, T* state) {
  constexpr size_t lanes = lane_count<T>;
  std::fill_n(state, path_state_size<T>(disparities), T{0});
  std::fill_n(state + disparities * lanes, lanes, unreachable<T>);
}

/// A state in memory of its own, [row][lanes].
template <class T>
struct PackedState {
  T* HWY_RESTRICT rows;
  HWY_INLINE Vector<T> load(size_t row) const { return hn::Load(Lanes<T>(), rows + row * lane_count<T>); }
  HWY_INLINE void store(size_t row, Vector<T> v) const { hn::Store(v, Lanes<T>(), rows + row * lane_count<T>); }
};

/// A part of the states of a row of pixels, [row][pitch]. The path comes from `step` columns to the right.
template <class T>
struct SlantedState {
  T* rows;
  ptrdiff_t pitch, step;
  HWY_INLINE Vector<T> load(size_t row) const { return hn::LoadU(Lanes<T>(), rows + static_cast<ptrdiff_t>(row) * pitch + step); }
  HWY_INLINE void store(size_t row, Vector<T> v) const { hn::StoreU(v, Lanes<T>(), rows + static_cast<ptrdiff_t>(row) * pitch); }
};

/// Moves a path's state to the next pixel. cost(d) gives the pixel's costs; visit(d, m, cost) is called for each disparity.
template <class T, class State, class Cost, class Visit>
HWY_INLINE void path_step(T p1_value, Vector<T> p2, size_t disparities, const Cost& cost, State state, Visit& visit) {
  const auto p1 = hn::Set(Lanes<T>(), p1_value);
  const auto lowest = state.load(disparities + 1);
  const auto jump = add_bounded(lowest, p2);
  auto below = hn::Set(Lanes<T>(), unreachable<T>), here = state.load(0), new_lowest = below;
#pragma GCC unroll 4
  for (size_t d = 0; d < disparities; ++d) {
    const auto above = state.load(d + 1);
    const auto c = cost(d);
    const auto beside = add_bounded(hn::Min(below, above), p1);
    const auto m = hn::Sub(hn::Min(hn::Min(beside, here), jump), lowest);
    const auto path_cost = hn::Add(m, c);
    visit(d, m, c);
    new_lowest = hn::Min(new_lowest, path_cost);
    below = here;
    here = above;
    state.store(d, path_cost);
  }
  state.store(disparities + 1, new_lowest);
}

/// A visitor that keeps nothing: the state alone is wanted.
struct Pass {
  template <class V>
  HWY_INLINE void operator()(size_t, V, V) {}
};

/// A visitor that keeps m.
template <class T>
struct KeepPath {
  T* HWY_RESTRICT m_row;
  HWY_INLINE void operator()(size_t d, Vector<T> m, Vector<T>) { hn::Store(m, Lanes<T>(), m_row + d * lane_count<T>); }
};

/// A visitor that keeps m, and the costs for later steps at this pixel.
template <class T>
struct KeepPathAndCost {
  T* HWY_RESTRICT m_row;
  T* HWY_RESTRICT cost_row;
  HWY_INLINE void operator()(size_t d, Vector<T> m, Vector<T> cost) {
    hn::Store(m, Lanes<T>(), m_row + d * lane_count<T>);
    hn::Store(cost, Lanes<T>(), cost_row + d * lane_count<T>);
  }
};

/// A visitor that adds m to the sum of other paths.
template <class T>
struct AddPath {
  T* HWY_RESTRICT m_row;
  HWY_INLINE void operator()(size_t d, Vector<T> m, Vector<T>) {
    T* sum = m_row + d * lane_count<T>;
    hn::Store(hn::Add(m, hn::Load(Lanes<T>(), sum)), Lanes<T>(), sum);
  }
};

/// One pixel's costs per lane, read from memory, [d][lanes].
template <class T>
struct StoredCosts {
  const T* HWY_RESTRICT row;
  HWY_INLINE Vector<T> operator()(size_t d) const { return hn::Load(Lanes<T>(), row + d * lane_count<T>); }
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
