// SPDX-License-Identifier: Apache-2.0
// Whether every number of a vector, a matrix or a list is finite. Thread rule: pure functions.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <vector>

namespace kuafu {

inline bool all_finite(double value) { return std::isfinite(value); }

template <glm::length_t N, class T, glm::qualifier Q>
bool all_finite(const glm::vec<N, T, Q>& v) {
  for (glm::length_t i = 0; i < N; ++i)
    if (!std::isfinite(v[i])) return false;
  return true;
}

template <glm::length_t Columns, glm::length_t Rows, class T, glm::qualifier Q>
bool all_finite(const glm::mat<Columns, Rows, T, Q>& m) {
  for (glm::length_t c = 0; c < Columns; ++c)
    if (!all_finite(m[c])) return false;
  return true;
}

template <class T>
bool all_finite(const std::vector<T>& values) {
  return std::ranges::all_of(values, [](const T& v) { return all_finite(v); });
}

}  // namespace kuafu
