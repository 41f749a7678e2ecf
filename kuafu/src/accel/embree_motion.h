// SPDX-License-Identifier: Apache-2.0
// Instances that move, as Embree takes them: steps of a motion over its time range, between which it turns rotations evenly and
// translations straight. Thread rule: externally synchronised.
#pragma once

#include "accel/embree_handle.h"
#include "accel/placement.h"

namespace kuafu {

/// Sets the instance's motion by enough steps that interpolation between them errs by micrometres. Throws KS_ERROR_UNSUPPORTED for an
/// instance that turns too far.
void set_motion(RTCGeometry geometry, const Placement& placement);

}  // namespace kuafu
