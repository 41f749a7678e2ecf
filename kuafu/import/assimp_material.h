// SPDX-License-Identifier: Apache-2.0
// Phong-style materials (MTL, Collada) as assimp gives them, into kuafu's GGX model.
#pragma once

#include <assimp/material.h>

#include <map>
#include <string>

#include "import/assimp_textures.h"

namespace kuafu {

/// base colour = diffuse (times map_Kd); emission = Ke; ior = Ni; specular = mean of Ks, and 0 for illum 0 and 1, which have no highlight.
/// Roughness from the shininess: GGX alpha^2 = 2 / (Ns + 2) matches the Blinn-Phong lobe's width (Walter et al. 2007, section 5.2);
/// a PBR roughness or metallic (Pr, Pm) stands as it is. Transmission = 1 - d for the glass models illum 4, 6, 7 and 9, which are also
/// smooth. With another model d is alpha (KUAFU_ALPHA_BLEND).
/// Values outside a field's range are clamped, with a warning.
Material read_material(Import& import, const aiMaterial& from, AssimpTextures& textures);

}  // namespace kuafu
