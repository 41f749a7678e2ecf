// SPDX-License-Identifier: Apache-2.0
// Material libraries of OBJ files (Wavefront, Advanced Visualizer manual, chapter 5), with the physically based extension Pr, Pm, norm.
#pragma once

#include <map>
#include <string>

#include "import/phong_material.h"

namespace kuafu {

/// Adds the materials of a library, or of several: `names` is one name with blanks, or a list. Warns of libraries that cannot be opened and
/// of statements that are not rendered. Throws KS_ERROR_FILE with library and line for an invalid number.
void read_mtl(Import& import, const std::string& names, std::map<std::string, PhongMaterial>& materials);

}  // namespace kuafu
