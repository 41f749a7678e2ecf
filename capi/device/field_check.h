// SPDX-License-Identifier: Apache-2.0
// Checks that generated code calls (capi/generation). Each throws KS_ERROR_INVALID_ARGUMENT with the field, its value and the remedy.
// `owner` stands before the name ("left signal: ", "material 'oak': ", or ""). Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace ks {

/// The name of a field as error messages show it.
struct FieldName {
  const std::string& owner;
  const char* name;
  const char* unit;  // "" = none
};

/// Throws unless low <= value <= high; NaN always throws.
void check_range(const FieldName& field, double value, double low, double high);
/// Throws unless value > low and finite.
void check_above(const FieldName& field, double value, double low);
/// Throws for NaN and infinity.
void check_finite(const FieldName& field, double value);
void check_allowed(const FieldName& field, uint32_t value, std::span<const uint32_t> allowed);
/// Throws unless the value is one of `names`, which are numbered from `first`.
void check_choice(const FieldName& field, uint32_t value, uint32_t first, std::span<const char* const> names);
/// Throws unless the numbers make a valid ks_lens.
void check_lens(const std::string& owner, uint32_t model, std::span<const double> distortion);

}  // namespace ks
