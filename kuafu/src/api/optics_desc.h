// SPDX-License-Identifier: Apache-2.0
// Reads and checks a kuafu_optics_desc. Thread rule: pure functions.
#pragma once

#include <string>

#include "kuafu/kuafu.h"
#include "scene/camera.h"

namespace kuafu {

/// NULL gives perfect optics. Errors name `view`, the field and the number.
Optics read_optics(const kuafu_optics_desc* desc, const std::string& view);

}  // namespace kuafu
