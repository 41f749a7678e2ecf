// The imager's formula, written for reading: double precision, one pixel after the other.
#pragma once

#include <vector>

#include "signal/signal.h"

namespace simsense::reference {

std::vector<uint8_t> measure(const SignalParameters& parameters, const NoiseKey& key, const std::vector<double>& input, uint32_t width,
                             uint32_t height);

}  // namespace simsense::reference
