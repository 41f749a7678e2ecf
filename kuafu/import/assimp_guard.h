// SPDX-License-Identifier: Apache-2.0
// What assimp 5.2.5 takes on trust and then crashes on or never returns from, where a clear error is better than the end of the process.
#pragma once

#include <assimp/scene.h>

#include <string_view>

namespace kuafu {

/// The header of a PLY file: known lines only, at most 1000 of them, an end, and no more elements than the file has bytes for.
void check_ply(std::string_view file);

/// After reading, before triangulation: every face has corners, and they are vertices of its mesh; every material and mesh index exists.
void check_read(const aiScene& file);

}  // namespace kuafu
