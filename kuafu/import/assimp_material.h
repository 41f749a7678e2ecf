// SPDX-License-Identifier: Apache-2.0
// Materials as assimp gives them.
#pragma once

#include <assimp/material.h>

#include "import/phong_material.h"

namespace kuafu {

/// Converts assimp's material; warns of images that are not read.
PhongMaterial phong_of(Import& import, const aiMaterial& from);

}  // namespace kuafu
