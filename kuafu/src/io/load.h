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

/// Appends a file's content to `scene`; `root_to_world` stands before every node. Returns warnings: what the file has and the renderer
/// ignores. Throws ks::Error that names the file and the field; the scene is then unchanged. name: of the file in both; empty: its path.
std::vector<std::string> load_file(Scene& scene, const std::filesystem::path& path, const glm::dmat4& root_to_world,
                                   const LoadOptions& options = load_options_from_environment(), const std::string& name = "");

}  // namespace kuafu
