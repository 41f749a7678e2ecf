// SPDX-License-Identifier: Apache-2.0
// Material libraries of OBJ files (Wavefront, Advanced Visualizer manual, chapter 5), with the physically based extension Pr, Pm, norm.
#pragma once

#include <map>
#include <string>

#include "import/phong_material.h"

namespace kuafu {

/// Adds the materials of the libraries that `names` is: one name with blanks, or several. One that cannot be opened is said, and so are
/// statements that are not rendered. Throws KS_ERROR_FILE that names library and line for what is no number.
void read_mtl(Import& import, const std::string& names, std::map<std::string, PhongMaterial>& materials);

}  // namespace kuafu
