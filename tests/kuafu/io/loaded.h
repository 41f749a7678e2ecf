// SPDX-License-Identifier: Apache-2.0
// A scene file as tests of the readers see it: what is in it, and what was said about it.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
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
  std::string error;  // empty: it was loaded

  [[nodiscard]] const kuafu::Material& material(size_t instance = 0) const {
    return scene.materials()[scene.instances()[instance].materials.at(0)];
  }
};

inline Loaded load_path(const std::filesystem::path& path, const glm::dmat4& root = glm::dmat4(1.0)) {
  Loaded out;
  out.warnings = kuafu::load_file(out.scene, path, root);
  return out;
}

/// An error is one line that begins with the file's name, and leaves the scene as it was.
inline Loaded try_path(const std::filesystem::path& path, const kuafu::LoadOptions& options = {}) {
  Loaded out;
  try {
    out.warnings = kuafu::load_file(out.scene, path, glm::dmat4(1.0), options);
  } catch (const ks::Error& error) {
    out.error = error.what();
    const kuafu::Scene& s = out.scene;
    EXPECT_TRUE(s.meshes().empty() && s.textures().empty() && s.materials().empty() && s.instances().empty()) << "the scene changed";
    EXPECT_EQ(out.error.find(path.string()), 0u) << out.error;
    EXPECT_EQ(out.error.find('\n'), std::string::npos) << out.error;
  }
  return out;
}

/// What a .glb file of the writer's gives.
inline Loaded load_glb(GltfWriter& writer, const glm::dmat4& root = glm::dmat4(1.0)) {
  const Folder folder;
  writer.write_glb(folder / "a.glb");
  return load_path(folder / "a.glb", root);
}

inline Loaded try_glb(GltfWriter& writer, const kuafu::LoadOptions& options = {}) {
  const Folder folder;
  writer.write_glb(folder / "a.glb");
  return try_path(folder / "a.glb", options);
}

inline bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

inline bool warns(const Loaded& loaded, const std::string& part) {
  return std::ranges::any_of(loaded.warnings, [&](const std::string& w) { return has(w, part); });
}

inline void expect_error(const std::string& error, const std::string& part) { EXPECT_TRUE(has(error, part)) << part << ": " << error; }
inline void expect_error(GltfWriter& writer, const std::string& part) { expect_error(try_glb(writer).error, part); }

inline void expect_warning(const Loaded& loaded, const std::string& part) {
  EXPECT_TRUE(warns(loaded, part)) << "no warning with '" << part << "'";
}

}  // namespace scene_test
