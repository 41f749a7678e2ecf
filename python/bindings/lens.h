// SPDX-License-Identifier: Apache-2.0
// A lens of either library, from Python.
#pragma once

#include <algorithm>
#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "bindings/errors.h"
#include "ks/lens.h"

namespace ks_python {

inline constexpr std::array<std::string_view, 2> lens_models{"brown_conrady", "kannala_brandt"};

template <class Api>
uint32_t read_lens_model(const std::string& name) {
  return index_of_name<Api>(lens_models, name, "lens_model");
}

/// 4, 5 or 8 coefficients; the others are 0.
template <class Api>
void read_distortion(const std::vector<double>& values, ks_lens& lens) {
  if (values.size() != 4 && values.size() != 5 && values.size() != 8)
    raise_argument<Api>("distortion has " + std::to_string(values.size()) + " numbers, it needs 4, 5 or 8");
  std::ranges::fill(lens.distortion, 0.0);
  std::ranges::copy(values, lens.distortion);
}

}  // namespace ks_python
