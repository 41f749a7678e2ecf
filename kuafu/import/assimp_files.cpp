// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_files.h"

#include <assimp/MemoryIOWrapper.h>

#include <algorithm>
#include <cstring>

#include "device/error.h"

namespace kuafu {
namespace {

class FileInMemory final : public Assimp::MemoryIOStream {
 public:
  explicit FileInMemory(std::vector<uint8_t> bytes) : MemoryIOStream(bytes.data(), bytes.size()), bytes_(std::move(bytes)) {}

 private:
  std::vector<uint8_t> bytes_;  // moving it left them where they are
};

}  // namespace

std::vector<uint8_t> SceneFiles::read_named(const char* name) const {
  if (import_.path.filename() == name) return scene_file_;
  std::string uri(name);
  std::replace(uri.begin(), uri.end(), '\\', '/');
  return import_.folder.read(uri);
}

bool SceneFiles::Exists(const char* name) const {
  try {
    return !read_named(name).empty();
  } catch (const ks::Error&) {
    return false;
  }
}

Assimp::IOStream* SceneFiles::Open(const char* name, const char* mode) {
  if (std::strchr(mode, 'w') != nullptr) return nullptr;
  try {
    return new FileInMemory(read_named(name));
  } catch (const ks::Error& error) {
    // Assimp itself says that a file is not there, if it was asked for and not tried by guess.
    const std::string_view reason(error.what());
    if (!reason.starts_with("cannot open")) import_.warn(error.what());
    return nullptr;
  }
}

void WarningStream::write(const char* message) {
  // "Warn,  T12345: OBJ: ..." without the thread.
  const char* text = std::strstr(message, ": ");
  const std::string_view said(text == nullptr ? message : text + 2);
  if (said.find("Invalid opacity value") != std::string_view::npos) return;
  import_.warn(std::string(said.substr(0, said.find_last_not_of(" \n") + 1)));
}

}  // namespace kuafu
