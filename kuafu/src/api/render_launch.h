// SPDX-License-Identifier: Apache-2.0
// Reads and checks a kuafu_render_desc; the result can be rendered. Errors name the field and the numbers. Thread rule: pure functions.
#pragma once

#include "device/device.h"
#include "frame/launch.h"
#include "kuafu/kuafu.h"

namespace kuafu {

Launch read_launch(const kuafu_render_desc* desc, const std::shared_ptr<ks::Device>& device);

/// Reads a left and a right view in each environment: all left ones, then all right ones.
Launch read_pair(const kuafu_render_desc& pair, uint32_t environments, const ks::Device& device);

}  // namespace kuafu
