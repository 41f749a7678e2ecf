// SPDX-License-Identifier: Apache-2.0
// A scene file as tests of the readers see it: what is in it, and what was said about it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "io/load.h"

namespace scene_test {

struct Loaded {
  kuafu::Scene scene;
  std::vector<std::string> warnings;
};

inline Loaded load_path(const std::filesystem::path& path, const glm::dmat4& root = glm::dmat4(1.0)) {
  Loaded out;
  out.warnings = kuafu::load_file(out.scene, path, root);
  return out;
}

}  // namespace scene_test
