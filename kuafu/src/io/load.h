// SPDX-License-Identifier: Apache-2.0
// Reads scene files, each in a helper program of its own (kuafu/import), for scene files come from strangers: what is safe, and what a file
// may cost, stands in README.md here. Thread rule: distinct scenes may be loaded at once.
//
// What of glTF, Wavefront, Collada, STL and PLY is rendered stands in kuafu/import/README.md. World axes are the file's own; assimp brings
// Collada's declared up axis to +y and its declared unit to metres. A light's candela and lux become W/sr and W/m^2 by 683 lm/W.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/load_options.h"
#include "scene/scene.h"

namespace kuafu {

/// Appends a file's content to `scene`; `root_to_world` applies to every node. Returns warnings about content that the renderer ignores.
/// Throws ks::Error with the file and the field, and leaves the scene unchanged. name: the file's name in messages; empty: its path.
std::vector<std::string> load_file(Scene& scene, const std::filesystem::path& path, const glm::dmat4& root_to_world,
                                   const LoadOptions& options = load_options_from_environment(), const std::string& name = "");

}  // namespace kuafu
