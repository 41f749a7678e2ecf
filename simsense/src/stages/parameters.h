// SPDX-License-Identifier: Apache-2.0
// Checks of simsense_parameters, and their conversion to each stage's parameters.
#pragma once

#include "depth/depth.h"
#include "match/matcher.h"
#include "simsense/simsense.h"

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT for the first invalid parameter, with name, value and range.
void check_parameters(const simsense_parameters& parameters);

/// Throws KS_ERROR_INVALID_ARGUMENT if the region of interest does not lie in an image of this size.
void check_region(const simsense_parameters& parameters, uint32_t width, uint32_t height);

MatchParameters match_parameters(const simsense_parameters& parameters);
DepthRange depth_range(const simsense_parameters& parameters);

}  // namespace simsense
