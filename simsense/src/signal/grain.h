// SPDX-License-Identifier: Apache-2.0
// Standard normal numbers that neighbouring pixels share as a point spread function makes them: what gives speckle its grain. Each number
// alone is N(0, 1), so a quantile of it keeps its law; numbers d pixels apart correlate by exp(-d^2 / (4 sigma^2)).
#pragma once

#include <vector>

namespace simsense {

/// Weights -radius..radius of the Gaussian PSF along one axis, their squares summing to 1; radius is 4 sigma, rounded up.
std::vector<float> grain_kernel(float sigma_px);

}  // namespace simsense
