// SPDX-License-Identifier: Apache-2.0
// One file on its way into a scene: readers fill `scene`, and main.cpp hands it to the host.
#pragma once

#include <filesystem>
#include <string>
#include <unordered_set>
#include <vector>

#include "import/budget.h"
#include "import/scene_folder.h"
#include "scene/scene.h"

namespace kuafu {

struct Import {
  Import(std::filesystem::path scene_file, SceneFolder& scene_folder, Budget& its_budget)
      : path(std::move(scene_file)), folder(scene_folder), budget(its_budget) {}

  std::filesystem::path path;
  SceneFolder& folder;
  Budget& budget;
  glm::dmat4 root_to_world{1.0};
  Scene scene;
  std::vector<std::string> warnings;  // each said once; after most_warnings (io/wire.h) they are counted

  void warn(const std::string& text);
  /// Adds a last warning that counts the ones left out.
  void close_warnings();

 private:
  std::unordered_set<std::string> said_;
  uint64_t unsaid_ = 0;
};

/// Cleans a name that a file gives: one line of at most 200 bytes.
std::string clean_name(std::string_view name);

/// Read the scene file. Errors name the field, and the host puts the file's path before them.

void import_gltf(Import& import);
void import_assimp(Import& import);
void import_mesh(Import& import);

}  // namespace kuafu
