// SPDX-License-Identifier: Apache-2.0
// The Gaussian of the integers: exp(-t) I_n(t), whose variance is exactly t and whose blurs add up, unlike a sampled Gaussian's
// (Lindeberg, Scale-space for discrete signals, 1990). Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <vector>

namespace kuafu {

/// Taps on one side of the middle that hold all but 1e-6 of the light.
uint32_t gaussian_radius(double variance);
/// The weights of the middle tap and `radius` taps on one side; both sides and the middle sum to 1.
std::vector<float> gaussian_kernel(double variance, uint32_t radius);

}  // namespace kuafu
