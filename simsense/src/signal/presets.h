// SPDX-License-Identifier: Apache-2.0
// Measured imagers by name; what they are stands in simsense.h.
#pragma once

#include "simsense/simsense.h"

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT with the known names.
simsense_signal signal_preset(const char* name);

}  // namespace simsense
