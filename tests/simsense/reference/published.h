// SPDX-License-Identifier: Apache-2.0
// The published SimSense (github.com/angli66/simsense) as it computes, faults included, written from an analysis of its stages: one plain
// function, sharing nothing with the engine nor with the other reference stages but the rig's types and OpenCV. Integer stages are its
// integers; float stages are single precision with one rounding per multiply-add, as a GPU computes them.
#pragma once

#include <cstdint>
#include <vector>

#include "simsense/simsense.h"

namespace simsense::reference {

/// left, right: packed [height][width]. Depth, packed: of the RGB camera where the rig has one, else of the (rectified) left one; metres.
/// Of the parameters the matching and depth ones count; noise is off, the subpixel step is the parabola. RGB and IR lenses are ignored.
std::vector<float> published_depth(const simsense_rig_desc& rig, const simsense_parameters& parameters, const std::vector<uint8_t>& left,
                                   const std::vector<uint8_t>& right);

}  // namespace simsense::reference
