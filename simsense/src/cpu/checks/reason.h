// SPDX-License-Identifier: Apache-2.0
// Reasons of invalid pixels. If the left image itself explains a rejection, the reason is the image's. Thread rule: pure function; the
// result does not depend on the number of workers.
#pragma once

#include "checks/reason.h"
#include "match/matcher.h"

namespace ks {
class ThreadPool;
}

namespace simsense {

/// Replaces reasons of the stages (not_unique, occluded, isolated, speckle, out_of_range, low_texture) by the left image's own (saturated,
/// low_texture) where it explains them. reason: packed [height][width].
void find_reasons(const ReasonParameters& parameters, ConstImage left, uint32_t width, uint32_t height, MatchReason* reason,
                  ks::ThreadPool& workers);

}  // namespace simsense
