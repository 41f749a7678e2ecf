// SPDX-License-Identifier: Apache-2.0
// Reads scene files, each in a helper program of its own (kuafu/import), for scene files come from strangers: what is safe, and what a file
// may cost, stands in README.md here. Thread rule: distinct scenes may be loaded at once.
//
// glTF 2.0 (.gltf .glb): meshes, pbrMetallicRoughness, KHR_materials_ior / _transmission (without _volume's thicknessFactor: a sheet) /
// _volume / _specular / _emissive_strength, extras.ir_albedo and extras.ir_emission of a material, KHR_lights_punctual point lights,
// perspective cameras, textures. World axes are the file's own. A point light's candela are taken as W/sr one to one: the file's
// photometric scale is not known to be anything else. Wavefront, Collada, STL, PLY (.obj .dae .stl .ply): meshes, nodes and materials as
// assimp gives them; it brings Collada's declared up axis to +y and its declared unit to metres.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/load_options.h"
#include "scene/scene.h"

namespace kuafu {

/// Appends a file's content to `scene`; `root_to_world` stands before every node. Returns warnings: what the file has and the renderer
/// ignores. Throws ks::Error that names the file and the field; the scene is then unchanged.
std::vector<std::string> load_file(Scene& scene, const std::filesystem::path& path, const glm::dmat4& root_to_world,
                                   const LoadOptions& options = load_options_from_environment());

}  // namespace kuafu
