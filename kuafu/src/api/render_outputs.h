// SPDX-License-Identifier: Apache-2.0
// Which outputs there are, and where the caller wants them: kuafu_output_desc, checked. Thread rule: pure functions.
#pragma once

#include "device/device.h"
#include "frame/launch.h"
#include "kuafu/kuafu.h"
#include "scene/scene.h"

namespace kuafu {

/// Fills launch.outputs; the views must have been read.
void read_outputs(const kuafu_render_desc& desc, const ks::Device& device, Launch& launch);

/// Throws if an id of the scene exceeds the format of the output that asks for it.
void check_ids_fit(const Launch& launch, const Scene& scene);

}  // namespace kuafu
