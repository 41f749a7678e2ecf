#include "io/load.h"

#include <algorithm>
#include <cctype>
#include <stdexcept>

#include "device/error.h"
#include "io/import.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

using Reader = void (*)(Import&);

Reader reader_of(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".gltf" || extension == ".glb") return import_gltf;
  if (extension == ".obj" || extension == ".dae" || extension == ".stl" || extension == ".ply") return import_assimp;
  ks::fail(KS_ERROR_UNSUPPORTED, "the name ends in '%s': scene files are .gltf .glb .obj .dae .stl .ply", extension.c_str());
}

void read(Import& import) {
  const Reader reader = reader_of(import.path);
  std::error_code error;
  const auto status = std::filesystem::status(import.path, error);
  if (!std::filesystem::exists(status)) ks::fail(KS_ERROR_FILE, "there is no such file");
  if (!std::filesystem::is_regular_file(status)) ks::fail(KS_ERROR_FILE, "this is not a regular file");
  reader(import);
  const Scene& scene = import.scene;
  if (scene.instances().empty() && scene.lights().empty() && scene.cameras().empty())
    ks::fail(KS_ERROR_FILE, "there is no mesh, light or camera in it");
}

}  // namespace

std::string lower_extension(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

void Import::warn(const std::string& text) {
  if (std::find(warnings.begin(), warnings.end(), text) == warnings.end()) warnings.push_back(text);
}

std::vector<std::string> load_file(Scene& scene, const std::filesystem::path& path, const glm::dmat4& root_to_world) {
  check_affine(root_to_world, "root_to_world");
  Import import{.path = path, .root_to_world = root_to_world};
  try {
    read(import);
  } catch (const ks::Error& error) {
    // What is an invalid argument to Scene is an invalid file here.
    const bool content = error.status() == KS_ERROR_INVALID_ARGUMENT;
    ks::fail(content ? KS_ERROR_FILE : error.status(), "%s: %s", path.c_str(), error.what());
  } catch (const std::length_error&) {
    ks::fail(KS_ERROR_FILE, "%s: a size in it is beyond all memory", path.c_str());
  }
  for (std::string& warning : import.warnings) warning = path.string() + ": " + warning;
  scene.append(std::move(import.scene));
  return std::move(import.warnings);
}

}  // namespace kuafu
