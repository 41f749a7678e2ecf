// SPDX-License-Identifier: Apache-2.0
// What assimp 5.2.5 takes on trust and then crashes on or never returns from, where a clear error is better than the end of the process.
#pragma once

#include <assimp/scene.h>

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "import/import.h"

namespace kuafu {

/// The header of a PLY file: known lines only, at most 1000 of them, an end, and no more elements than the file has bytes for.
void check_ply(std::string_view file);

/// A Collada file as assimp reads it right: in UTF-8, without blanks around numbers and names, and without cameras, lights and animations,
/// which are not shown. Throws KS_ERROR_FILE for an accessor that leaves the array that it names.
std::vector<uint8_t> plain_collada(Import& import, std::string_view file);

/// An MTL file without the statements before its first material, which nothing says what they are of; left_out(line) is told of each.
std::vector<uint8_t> guarded_mtl(const std::vector<uint8_t>& file, const std::function<void(const std::string&)>& left_out);

/// After reading, before triangulation: every face has corners, and they are vertices of its mesh; every material and mesh index exists.
void check_read(const aiScene& file);

}  // namespace kuafu
