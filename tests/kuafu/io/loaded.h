// SPDX-License-Identifier: Apache-2.0
// A scene file as tests of the readers see it: what is in it, and what was said about it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "device/error.h"
#include "io/load.h"
#include "kuafu/io/sample_files.h"

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

/// What a .glb file of the writer's gives.
inline Loaded load_glb(GltfWriter& writer, const glm::dmat4& root = glm::dmat4(1.0)) {
  const Folder folder;
  writer.write_glb(folder / "a.glb");
  return load_path(folder / "a.glb", root);
}

/// The error of loading it; "accepted" where there is none.
inline std::string glb_error_of(GltfWriter& writer) {
  try {
    load_glb(writer);
  } catch (const ks::Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace scene_test
