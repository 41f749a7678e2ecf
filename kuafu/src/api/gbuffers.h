// SPDX-License-Identifier: Apache-2.0
// G-buffers of the C API as the renderer takes them. Thread rule: pure functions.
#pragma once

#include "gbuffer/gbuffer_light.h"
#include "kuafu/kuafu.h"

namespace kuafu {

/// Reads and checks the caller's struct. Throws with the field and its value.
GbufferLaunch read_gbuffers(const kuafu_gbuffer_desc* desc, const Scene& scene, const std::shared_ptr<ks::Device>& device);

}  // namespace kuafu
