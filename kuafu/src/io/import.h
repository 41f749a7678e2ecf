// One file on its way into a scene: readers fill `scene`, which is appended to the user's scene when all went well.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

struct Import {
  std::filesystem::path path;
  glm::dmat4 root_to_world{1.0};
  Scene scene;
  std::vector<std::string> warnings;  // each said once

  void warn(const std::string& text);
};

/// ".gltf" of "A.GLTF".
std::string lower_extension(const std::filesystem::path& path);

/// Errors they throw name the field; load_file puts the file's path before it.
void import_gltf(Import& import);
void import_assimp(Import& import);

}  // namespace kuafu
