// SPDX-License-Identifier: Apache-2.0
// World box of an instance, of all places that it passes where it moves. Thread rule: pure function.
#pragma once

#include "accel/bvh_builder.h"
#include "accel/placement.h"

namespace kuafu {

/// local: of its mesh.
Box placement_box(const Box& local, const Placement& placement);

}  // namespace kuafu
