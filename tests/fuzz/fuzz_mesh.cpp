// SPDX-License-Identifier: Apache-2.0
// Bytes as a mesh file: OBJ, PLY and STL are read in this process, Collada by the helper program as a host has it read: a scene, or one
// error. The first byte chooses the format. What follows a byte of 0 in an OBJ file is the MTL file beside it.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <string>
#include <string_view>

#include <unistd.h>

#include "device/error.h"
#include "import/import.h"
#include "io/load.h"

namespace {

void write(const std::filesystem::path& path, std::string_view bytes) {
  std::FILE* out = std::fopen(path.c_str(), "wb");
  if (out == nullptr) __builtin_trap();
  if (!bytes.empty()) std::fwrite(bytes.data(), 1, bytes.size(), out);
  std::fclose(out);
}

void read_here(const std::filesystem::path& file) {
  kuafu::Budget budget;
  budget.limit_claims(256 << 20);
  kuafu::SceneFolder folder(file, false, budget);
  kuafu::Import import(file, folder, budget);
  kuafu::import_mesh(import);
  (void)import.scene.bounds();
}

void read_by_helper(const std::filesystem::path& file) {
  kuafu::Scene scene;
  try {
    kuafu::LoadOptions options;
    options.seconds = 2;
    (void)kuafu::load_file(scene, file, glm::dmat4(1.0), options);
    (void)scene.bounds();
  } catch (const ks::Error& error) {
    const std::string_view text = error.what();
    if (!text.starts_with(file.string()) || text.find('\n') != std::string_view::npos || !scene.meshes().empty()) __builtin_trap();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::filesystem::path folder = [] {
    std::string name = (std::filesystem::temp_directory_path() / "fuzz_mesh_XXXXXX").string();
    return std::filesystem::path(mkdtemp(name.data()));
  }();
  static constexpr const char* names[] = {"a.obj", "a.ply", "a.stl", "a.dae"};
  if (size == 0) return 0;
  const size_t format = data[0] % 4;
  const std::filesystem::path file = folder / names[format];
  std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (format == 0) {
    const size_t end = std::min(bytes.find('\0'), bytes.size());
    write(folder / "a.mtl", bytes.substr(std::min(end + 1, bytes.size())));
    bytes = bytes.substr(0, end);
  }
  write(file, bytes);
  if (format == 3) {
    read_by_helper(file);
    return 0;
  }
  try {
    read_here(file);
  } catch (const ks::Error&) {
  }
  return 0;
}
