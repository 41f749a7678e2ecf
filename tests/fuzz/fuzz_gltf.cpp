// SPDX-License-Identifier: Apache-2.0
// Bytes as a .gltf or .glb file, read in this process: a scene, or one error.
#include <cstdio>
#include <filesystem>
#include <string>

#include <unistd.h>

#include "device/error.h"
#include "import/import.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::filesystem::path file = [] {
    std::string name = (std::filesystem::temp_directory_path() / "fuzz_gltf_XXXXXX").string();
    return std::filesystem::path(mkdtemp(name.data())) / "a.glb";
  }();
  std::FILE* out = std::fopen(file.c_str(), "wb");
  if (out == nullptr) __builtin_trap();
  if (size > 0) std::fwrite(data, 1, size, out);
  std::fclose(out);
  kuafu::Budget budget;
  budget.limit_claims(256 << 20);
  try {
    kuafu::SceneFolder folder(file, false, budget);
    kuafu::Import import(file, folder, budget);
    kuafu::import_gltf(import);
    (void)import.scene.bounds();
    import.scene.animate(kuafu::none, 0.5);
  } catch (const ks::Error&) {
  }
  return 0;
}
