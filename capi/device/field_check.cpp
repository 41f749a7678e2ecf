// SPDX-License-Identifier: Apache-2.0
#include "device/field_check.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "device/error.h"

namespace ks {
namespace {

/// Whole numbers in full, others as %g.
std::string text(double value) {
  char out[32];
  const bool whole = std::floor(value) == value && std::abs(value) < 1e12;
  std::snprintf(out, sizeof out, whole ? "%.0f" : "%g", value);
  return out;
}

[[noreturn]] void refuse(const FieldName& field, const std::string& value, const std::string& wanted) {
  const std::string unit = *field.unit ? std::string(" ") + field.unit : "";
  fail(KS_ERROR_INVALID_ARGUMENT, "%s%s is %s%s: must be %s", field.owner.c_str(), field.name, value.c_str(), unit.c_str(), wanted.c_str());
}

}  // namespace

void check_range(const FieldName& field, double value, double low, double high) {
  const bool endless = std::isinf(high);
  if (value >= low && value <= high && !(endless && std::isinf(value))) return;
  refuse(field, text(value), endless ? "finite and >= " + text(low) : text(low) + ".." + text(high));
}

void check_above(const FieldName& field, double value, double low) {
  if (!(value > low) || std::isinf(value)) refuse(field, text(value), "finite and > " + text(low));
}

void check_finite(const FieldName& field, double value) {
  if (!std::isfinite(value)) refuse(field, text(value), "finite");
}

void check_allowed(const FieldName& field, uint32_t value, std::span<const uint32_t> allowed) {
  if (std::ranges::find(allowed, value) != allowed.end()) return;
  std::string list;
  for (size_t i = 0; i < allowed.size(); ++i) list += (i == 0 ? "" : i + 1 == allowed.size() ? " or " : ", ") + std::to_string(allowed[i]);
  refuse(field, std::to_string(value), list);
}

void check_choice(const FieldName& field, uint32_t value, uint32_t first, std::span<const char* const> names) {
  if (value >= first && value - first < names.size()) return;
  std::string list = "one of ";
  for (size_t i = 0; i < names.size(); ++i) list += (i == 0 ? "" : ", ") + std::string(names[i]) + " (" + std::to_string(first + i) + ")";
  refuse(field, std::to_string(value), list);
}

void check_lens(const std::string& owner, uint32_t model, std::span<const double> distortion) {
  check_choice({owner, "model", ""}, model, 0, std::array{"brown_conrady", "kannala_brandt"});
  for (size_t i = 0; i < distortion.size(); ++i)
    check_range({owner, ("distortion[" + std::to_string(i) + "]").c_str(), ""}, distortion[i], -1e6, 1e6);
}

}  // namespace ks
