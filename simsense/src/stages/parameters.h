// SPDX-License-Identifier: Apache-2.0
// The checks of simsense_parameters and their translation into what each stage takes.
#pragma once

#include "depth/depth.h"
#include "match/matcher.h"
#include "simsense/simsense.h"

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT with the name, the value and the range of the first parameter that cannot be.
void check_parameters(const simsense_parameters& parameters);

/// The same for the region of interest in an image of this size.
void check_region(const simsense_parameters& parameters, uint32_t width, uint32_t height);

MatchParameters match_parameters(const simsense_parameters& parameters);
DepthRange depth_range(const simsense_parameters& parameters);

}  // namespace simsense
