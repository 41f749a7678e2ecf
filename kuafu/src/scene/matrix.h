// SPDX-License-Identifier: Apache-2.0
// Between the C API's row-major matrices and glm's column-major ones.
#pragma once

#include <glm/glm.hpp>

namespace kuafu {

template <int N>
glm::mat<N, N, double> from_row_major(const double* rows) {
  glm::mat<N, N, double> m;
  for (int r = 0; r < N; ++r)
    for (int c = 0; c < N; ++c) m[c][r] = rows[N * r + c];
  return m;
}

template <int N>
void to_row_major(const glm::mat<N, N, double>& m, double* rows) {
  for (int r = 0; r < N; ++r)
    for (int c = 0; c < N; ++c) rows[N * r + c] = m[c][r];
}

}  // namespace kuafu
