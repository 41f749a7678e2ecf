// SPDX-License-Identifier: Apache-2.0
// Checks of files that assimp 5.2.5 trusts and then crashes on or never returns from. A clear error is better than the end of the process.
#pragma once

#include <assimp/scene.h>

#include <string_view>

#include "import/import.h"

namespace kuafu {

/// Rewrites a Collada file so that assimp reads it correctly: in UTF-8, without blanks around numbers and names, without cameras, lights
/// and animations, which are not shown. Throws KS_ERROR_FILE for an accessor that exceeds its array.
std::vector<uint8_t> plain_collada(Import& import, std::string_view file);

/// Checks a file that assimp has read, before triangulation: every face has corners that are vertices of its mesh, and every material and
/// mesh index exists.
void check_read(const aiScene& file);

}  // namespace kuafu
