// The checks of simsense_parameters and their translation into what each stage takes.
#pragma once

#include "depth/depth.h"
#include "matcher.h"
#include "simsense/simsense.h"

namespace simsense {

/// Throws KS_ERROR_INVALID_ARGUMENT with the name, the value and the range of the first parameter that cannot be.
void check_parameters(const simsense_parameters& parameters);

MatchParameters match_parameters(const simsense_parameters& parameters);
DepthRange depth_range(const simsense_parameters& parameters);

}  // namespace simsense
