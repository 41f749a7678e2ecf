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

#include "cpu/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace simsense::cpu::HWY_NAMESPACE {

template <class T>
struct Penalties {
  T p1, p2;
};

/// A path's state: L of the pixel before for each d, a row of `unreachable` (the neighbour of d = D - 1), and min over d of L.
template <class T>
constexpr size_t path_state_size(size_t disparities) {
  return (disparities + 2) * lane_count<T>;
}

/// Before the first pixel: all zero, so that L = C there.
template <class T>
void enter_image(size_t disparities, T* state) {
  constexpr size_t lanes = lane_count<T>;
  std::fill_n(state, path_state_size<T>(disparities), T{0});
  std::fill_n(state + disparities * lanes, lanes, unreachable<T>);
}

/// Moves the state one pixel on. cost(d) gives the pixel's costs; visit(d, m, cost) sees every disparity.
template <class T, class Cost, class Visit>
HWY_INLINE void path_step(Penalties<T> penalties, size_t disparities, const Cost& cost, T* HWY_RESTRICT state, Visit& visit) {
  const Lanes<T> tag;
  constexpr size_t lanes = lane_count<T>;
  T* lowest_row = state + (disparities + 1) * lanes;
  const auto p1 = hn::Set(tag, penalties.p1);
  const auto lowest = hn::Load(tag, lowest_row);
  const auto jump = add_bounded(lowest, hn::Set(tag, penalties.p2));
  auto below = hn::Set(tag, unreachable<T>), here = hn::Load(tag, state), new_lowest = below;
#pragma GCC unroll 4
  for (size_t d = 0; d < disparities; ++d) {
    const auto above = hn::Load(tag, state + (d + 1) * lanes);
    const auto c = cost(d);
    const auto beside = add_bounded(hn::Min(below, above), p1);
    const auto m = hn::Sub(hn::Min(hn::Min(beside, here), jump), lowest);
    const auto path_cost = hn::Add(m, c);
    visit(d, m, c);
    new_lowest = hn::Min(new_lowest, path_cost);
    below = here;
    here = above;
    hn::Store(path_cost, tag, state + d * lanes);
  }
  hn::Store(new_lowest, tag, lowest_row);
}

/// Visitors. The state alone is wanted:
struct Pass {
  template <class V>
  HWY_INLINE void operator()(size_t, V, V) {}
};

/// Keep m.
template <class T>
struct KeepPath {
  T* HWY_RESTRICT m_row;
  HWY_INLINE void operator()(size_t d, Vector<T> m, Vector<T>) { hn::Store(m, Lanes<T>(), m_row + d * lane_count<T>); }
};

/// Keep m, and the costs for the steps that meet this pixel again.
template <class T>
struct KeepPathAndCost {
  T* HWY_RESTRICT m_row;
  T* HWY_RESTRICT cost_row;
  HWY_INLINE void operator()(size_t d, Vector<T> m, Vector<T> cost) {
    hn::Store(m, Lanes<T>(), m_row + d * lane_count<T>);
    hn::Store(cost, Lanes<T>(), cost_row + d * lane_count<T>);
  }
};

/// Add m to the opposite path's.
template <class T>
struct AddPath {
  T* HWY_RESTRICT m_row;
  HWY_INLINE void operator()(size_t d, Vector<T> m, Vector<T>) {
    T* sum = m_row + d * lane_count<T>;
    hn::Store(hn::Add(m, hn::Load(Lanes<T>(), sum)), Lanes<T>(), sum);
  }
};

/// Costs of one pixel per lane that lie in memory, [d][lanes].
template <class T>
struct StoredCosts {
  const T* HWY_RESTRICT row;
  HWY_INLINE Vector<T> operator()(size_t d) const { return hn::Load(Lanes<T>(), row + d * lane_count<T>); }
};

}  // namespace simsense::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
