// SPDX-License-Identifier: Apache-2.0
// Median filter of a disparity map.
#pragma once

#include <cstddef>

namespace simsense::cpu {

/// Filters rows [first_row, end_row) of a packed [height][width] map by the size x size median (3, 5 or 7; 1 copies). Invalid pixels (-1)
/// count like any value; pixels nearer than size / 2 to the border are copied.
void median_rows(const float* disparity, size_t width, size_t height, size_t size, size_t first_row, size_t end_row, float* filtered);

}  // namespace simsense::cpu
