// SPDX-License-Identifier: Apache-2.0
// The imager written for reading: double precision, one stage after the other over the whole image, every variate the exact quantile at its
// pixel's word.
#pragma once

#include <vector>

#include "signal/key.h"
#include "simsense/simsense.h"

namespace simsense::reference {

/// x with Phi(x) = (word + 1/2) / 2^32.
double normal_quantile(uint32_t word);
/// The least n with P(Poisson(mean) <= n) >= (word + 1/2) / 2^32.
double poisson_quantile(double mean, uint32_t word);

/// input: [height][width]; laser: its part that has speckle, empty: all has. Counts, [height][width].
std::vector<uint16_t> measure(const simsense_signal& signal, const NoiseKey& key, const std::vector<double>& input, uint32_t width,
                              uint32_t height, const std::vector<double>& laser = {});

}  // namespace simsense::reference
