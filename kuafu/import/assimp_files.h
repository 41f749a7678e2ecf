// SPDX-License-Identifier: Apache-2.0
// assimp's door to the disk and its voice: files come through SceneFolder, messages become warnings of the import; and its materials.
#pragma once

#include <assimp/material.h>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/LogStream.hpp>
#include <string_view>

#include "import/import.h"
#include "import/phong_material.h"

namespace kuafu {

/// Gives assimp the scene's files. A forbidden file gives a warning and does not exist for assimp, which does without it or fails.
/// `scene_file`: the content that assimp reads as the scene file.
class SceneFiles final : public Assimp::IOSystem {
 public:
  SceneFiles(Import& import, std::vector<uint8_t> scene_file) : import_(import), scene_file_(std::move(scene_file)) {}
  bool Exists(const char* name) const override;
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* name, const char* mode) override;
  void Close(Assimp::IOStream* file) override { delete file; }

 private:
  [[nodiscard]] std::vector<uint8_t> read_named(const char* name) const;

  Import& import_;
  std::vector<uint8_t> scene_file_;
};

class WarningStream final : public Assimp::LogStream {
 public:
  explicit WarningStream(Import& import) : import_(import) {}
  void write(const char* message) override;

 private:
  Import& import_;
};

/// Converts assimp's material; warns of images that are not read.
PhongMaterial phong_of(Import& import, const aiMaterial& from);

/// Rewrites a Collada file so that assimp reads it correctly: in UTF-8, without blanks around numbers and names, without cameras, lights
/// and animations, which are not shown. Throws KS_ERROR_FILE for an accessor that exceeds its array: assimp 5.2.5 trusts it, and then
/// crashes or never returns.
std::vector<uint8_t> plain_collada(Import& import, std::string_view file);

}  // namespace kuafu
