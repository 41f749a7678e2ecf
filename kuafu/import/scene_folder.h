// SPDX-License-Identifier: Apache-2.0
// The files that a scene file may name: regular ones, inside the folder that it is in. A path that leaves the folder (by "..", from the
// root, or through a symbolic link) is refused, and so is everything that is no regular file: a FIFO would wait forever, a device may do
// anything.
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "import/budget.h"

namespace kuafu {

struct FileContent {
  std::vector<uint8_t> bytes;
  std::pair<dev_t, ino_t> identity;
};

class SceneFolder {
 public:
  /// `scene_file` is trusted, since the user named it. `outside` allows files outside its folder.
  SceneFolder(const std::filesystem::path& scene_file, bool outside, Budget& budget);

  /// Reads the scene file.
  [[nodiscard]] std::vector<uint8_t> read_scene_file() const;
  /// Reads a file by its name in the scene file, relative to the folder. If that fails it tries names as Windows programs write them: other
  /// case, backslashes, quotes or blanks around it, or the end of an absolute path. Throws KS_ERROR_FILE with the name.
  [[nodiscard]] std::vector<uint8_t> read(const std::string& name) const;

 private:
  [[nodiscard]] std::filesystem::path resolve(const std::string& name) const;
  /// Returns the canonical path of a file that may be read; nothing otherwise.
  [[nodiscard]] std::optional<std::filesystem::path> inside(const std::filesystem::path& path) const;

  /// Returns the bytes; the first read of a file raises the memory limit.
  [[nodiscard]] std::vector<uint8_t> counted(FileContent&& content) const;

  std::filesystem::path scene_file_, folder_, canonical_folder_;
  bool outside_;
  Budget& budget_;
  mutable std::set<std::pair<dev_t, ino_t>> seen_;
};

}  // namespace kuafu
