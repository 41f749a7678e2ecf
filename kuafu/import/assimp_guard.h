// SPDX-License-Identifier: Apache-2.0
// What assimp 5.2.5 takes on trust and then crashes on or never returns from, where a clear error is better than the end of the process.
#pragma once

#include <assimp/scene.h>

#include <string_view>

#include "import/import.h"

namespace kuafu {

/// A Collada file as assimp reads it right: in UTF-8, without blanks around numbers and names, and without cameras, lights and animations,
/// which are not shown. Throws KS_ERROR_FILE for an accessor that leaves the array that it names.
std::vector<uint8_t> plain_collada(Import& import, std::string_view file);

/// After reading, before triangulation: every face has corners, and they are vertices of its mesh; every material and mesh index exists.
void check_read(const aiScene& file);

}  // namespace kuafu
