// What assimp 5.2.5 takes on trust and then crashes or never returns on. Checked before and between its steps, so that a broken file is an
// error.
#pragma once

#include <assimp/scene.h>

#include <string_view>

namespace kuafu {

/// The header of a PLY file: known lines only, an end, and no more elements than the file has bytes for.
void check_ply(std::string_view file);

/// The attributes of a Collada file that its reader uses without looking: they must be there, and counts must fit the file.
void check_collada(std::string_view file);

/// After reading, before triangulation: every face has corners, and they are vertices of its mesh; every material and mesh index exists.
void check_read(const aiScene& file);

}  // namespace kuafu
