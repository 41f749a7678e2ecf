// SPDX-License-Identifier: Apache-2.0
// What the checks made from capi/generation call: each throws KS_ERROR_INVALID_ARGUMENT with the field, its value and the remedy.
// `owner` stands before the name ("left signal: ", "material 'oak': ", or ""). Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace ks {

/// A field as messages show it.
struct FieldName {
  const std::string& owner;
  const char* name;
  const char* unit;  // "" = none
};

/// low <= value <= high; NaN never is.
void check_range(const FieldName& field, double value, double low, double high);
/// value > low, and finite.
void check_above(const FieldName& field, double value, double low);
/// Finite; neither NaN nor infinite.
void check_finite(const FieldName& field, double value);
void check_allowed(const FieldName& field, uint32_t value, std::span<const uint32_t> allowed);
/// One of `names`, which count from `first`.
void check_choice(const FieldName& field, uint32_t value, uint32_t first, std::span<const char* const> names);
/// A ks_lens.
void check_lens(const std::string& owner, uint32_t model, std::span<const double> distortion);

}  // namespace ks
