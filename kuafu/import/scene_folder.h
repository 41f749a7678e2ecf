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
  /// `scene_file` is trusted, for the user named it; `outside` lifts the rule about the folder.
  SceneFolder(const std::filesystem::path& scene_file, bool outside, Budget& budget);

  /// The scene file itself.
  [[nodiscard]] std::vector<uint8_t> read_scene_file() const;
  /// A file by its name in the scene file: relative to the folder, else as Windows' programs may mean it: in another case, with
  /// backslashes, quotes or blanks around it, or by the end of an absolute path of theirs. Throws KS_ERROR_FILE that names it.
  [[nodiscard]] std::vector<uint8_t> read(const std::string& name) const;

 private:
  [[nodiscard]] std::filesystem::path resolve(const std::string& name) const;
  /// The canonical path, where there is something that may be read.
  [[nodiscard]] std::optional<std::filesystem::path> inside(const std::filesystem::path& path) const;

  /// The bytes; the first time that a file is read it allows memory.
  [[nodiscard]] std::vector<uint8_t> counted(FileContent&& content) const;

  std::filesystem::path scene_file_, folder_, canonical_folder_;
  bool outside_;
  Budget& budget_;
  mutable std::set<std::pair<dev_t, ino_t>> seen_;
};

}  // namespace kuafu
