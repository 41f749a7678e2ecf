// SPDX-License-Identifier: Apache-2.0
// Reads and checks a kuafu_render_desc; the result can be rendered. Errors name the field and the numbers. Thread rule: pure functions.
#pragma once

#include "device/device.h"
#include "frame/launch.h"
#include "gbuffer/gbuffer_light.h"
#include "kuafu/kuafu.h"
#include "scene/scene.h"

namespace kuafu {

Launch read_launch(const kuafu_render_desc* desc, const std::shared_ptr<ks::Device>& device);

/// Reads a left and a right view in each environment: all left ones, then all right ones.
Launch read_pair(const kuafu_render_desc& pair, uint32_t environments, const ks::Device& device);

/// Fills launch.outputs; the views must have been read.
void read_outputs(const kuafu_render_desc& desc, const ks::Device& device, Launch& launch);

/// Throws if an id of the scene exceeds the format of the output that asks for it.
void check_ids_fit(const Launch& launch, const Scene& scene);

/// Reads and checks the caller's struct. Throws with the field and its value.
GbufferLaunch read_gbuffers(const kuafu_gbuffer_desc* desc, const Scene& scene, const std::shared_ptr<ks::Device>& device);

}  // namespace kuafu
