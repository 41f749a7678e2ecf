// SPDX-License-Identifier: Apache-2.0
// Reads scene files, each in a helper program of its own (kuafu/import), for scene files come from strangers: what is safe, and what a file
// may cost, stands in README.md here. Thread rule: distinct scenes may be loaded at once.
//
// What of glTF, Wavefront, Collada, STL and PLY is rendered stands in kuafu/import/README.md. World axes are the file's own; assimp brings
// Collada's declared up axis to +y and its declared unit to metres. A light's candela and lux become W/sr and W/m^2 by 683 lm/W.
#pragma once

#include <algorithm>
#include <cctype>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// Limits of a scene file's cost and of the files that it may name. 0 = automatic.
struct LoadOptions {
  /// Memory that reading may take. Automatic: 1 GiB and 64 times the bytes of the files read, at most half of the machine's memory.
  uint64_t memory_bytes = 0;
  /// Processor time that reading may take. Automatic: 30 s and 1 s per MiB of the scene file.
  uint32_t seconds = 0;
  /// Whether the file may name files outside its own folder (above it, elsewhere by absolute path, or behind a symbolic link).
  bool outside_folder = false;
  /// Whether materials of opacity 0 stay unseen (show_transparent).
  bool keep_transparent = false;
  /// Folder of the helper programs; empty: looked for beside the library (import_process.h).
  std::filesystem::path helpers;
};

/// Returns automatic options, except for variables that are set: KUAFU_LOAD_MEMORY_MB, KUAFU_LOAD_SECONDS, KUAFU_LOAD_OUTSIDE=1,
/// KUAFU_LOAD_TRANSPARENT=1, KUAFU_HELPERS. A process with raised privileges ignores them. Throws KS_ERROR_INVALID_ARGUMENT for an invalid
/// number.
LoadOptions load_options_from_environment();

/// The options for a scene file of a certain size, with automatic values filled in.
struct LoadLimits {
  uint64_t memory_bytes = 0;       // at the start
  uint64_t memory_most_bytes = 0;  // as files are read, it grows up to this
  uint32_t seconds = 0;
};
LoadLimits load_limits(const LoadOptions& options, uint64_t file_bytes);

/// Bytes of memory that each byte of a file read allows.
inline constexpr uint64_t memory_per_file_byte = 64;

/// Appends a file's content to `scene`; `root_to_world` applies to every node. Returns warnings about content that the renderer ignores.
/// Throws ks::Error with the file and the field, and leaves the scene unchanged. name: the file's name in messages; empty: its path.
std::vector<std::string> load_file(Scene& scene, const std::filesystem::path& path, const glm::dmat4& root_to_world,
                                   const LoadOptions& options = load_options_from_environment(), const std::string& name = "");

/// Returns a path's extension in lower case: ".gltf" of "A.GLTF".
inline std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

/// Makes materials opaque that are invisible everywhere, unless `keep`. Returns a message for each. Exporters mix up opacity and
/// transparency (MTL's Tr, Collada's A_ONE and RGB_ZERO), and a whole body then has opacity 0.
std::vector<std::string> show_transparent(Scene& scene, bool keep);

/// Returns a message for each mesh whose triangles are lines or points and never move.
std::vector<std::string> without_area(const Scene& scene);

}  // namespace kuafu
