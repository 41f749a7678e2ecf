// SPDX-License-Identifier: Apache-2.0
#include "io/load.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <stdexcept>

#include "device/error.h"
#include "device/host_memory.h"
#include "io/import_process.h"
#include "io/wire.h"
#include "scene/validate.h"

namespace kuafu {
namespace {

constexpr uint64_t mebibyte = uint64_t{1} << 20;
constexpr uint64_t base_memory = 1024 * mebibyte;
constexpr uint64_t base_seconds = 30;

/// The number that an environment variable holds, 0 where it is not set.
uint64_t number_from(const char* variable, uint64_t most) {
  const char* text = secure_getenv(variable);
  if (text == nullptr || *text == '\0') return 0;
  const char* const end = text + std::strlen(text);
  uint64_t value = 0;
  const auto [at, error] = std::from_chars(text, end, value);
  if (error != std::errc() || at != end || value == 0 || value > most)
    ks::fail(KS_ERROR_INVALID_ARGUMENT, "the environment's %s is '%.40s', must be a whole number from 1 to %llu", variable, text,
             static_cast<unsigned long long>(most));
  return value;
}

const char* helper_of(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".gltf" || extension == ".glb") return "kuafu-import-gltf";
  if (extension == ".obj" || extension == ".stl" || extension == ".ply") return "kuafu-import-mesh";
  if (extension == ".dae") return "kuafu-import-assimp";
  ks::fail(KS_ERROR_UNSUPPORTED, "the name ends in '%.40s': scene files are .gltf .glb .obj .dae .stl .ply", extension.c_str());
}

uint64_t size_of_regular_file(const std::filesystem::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) ks::fail(KS_ERROR_FILE, "%s", errno == ENOENT ? "there is no such file" : std::strerror(errno));
  if (!S_ISREG(status.st_mode)) ks::fail(KS_ERROR_FILE, "this is not a regular file");
  return static_cast<uint64_t>(status.st_size);
}

/// Arguments of the helper's main() (kuafu/import/main.cpp). Hexadecimal floats pass unrounded.
std::vector<std::string> helper_arguments(const std::filesystem::path& path, const glm::dmat4& root_to_world, const LoadLimits& limits,
                                          bool outside_folder) {
  std::vector<std::string> arguments{path.string(),
                                     std::to_string(limits.memory_bytes),
                                     std::to_string(limits.memory_most_bytes),
                                     std::to_string(limits.seconds),
                                     outside_folder ? "1" : "0",
                                     std::to_string(getpid())};
  for (int column = 0; column < 4; ++column)
    for (int row = 0; row < 4; ++row) {
      std::array<char, 40> text{};
      std::snprintf(text.data(), text.size(), "%a", root_to_world[column][row]);
      arguments.emplace_back(text.data());
    }
  return arguments;
}

ImportAnswer read(const std::filesystem::path& path, const glm::dmat4& root_to_world, const LoadOptions& options) {
  const char* name = helper_of(path);
  const LoadLimits limits = load_limits(options, size_of_regular_file(path));
  const std::filesystem::path program = find_helper(name, options.helpers);
  ImportProcess helper(program, helper_arguments(path, root_to_world, limits, options.outside_folder), limits.seconds);
  return read_answer([&](void* to, size_t bytes) { helper.read(to, bytes); }, limits.memory_most_bytes);
}

}  // namespace

LoadOptions load_options_from_environment() {
  LoadOptions options;
  options.memory_bytes = number_from("KUAFU_LOAD_MEMORY_MB", uint64_t{1} << 24) * mebibyte;
  options.seconds = static_cast<uint32_t>(number_from("KUAFU_LOAD_SECONDS", 1000000));
  options.outside_folder = number_from("KUAFU_LOAD_OUTSIDE", 1) == 1;
  options.keep_transparent = number_from("KUAFU_LOAD_TRANSPARENT", 1) == 1;
  if (const char* folder = secure_getenv("KUAFU_HELPERS")) options.helpers = folder;
  return options;
}

LoadLimits load_limits(const LoadOptions& options, uint64_t file_bytes) {
  LoadLimits limits{};
  limits.memory_most_bytes = options.memory_bytes != 0 ? options.memory_bytes : std::max(ks::physical_memory_bytes() / 2, base_memory);
  const uint64_t by_size = base_memory + memory_per_file_byte * std::min(file_bytes, uint64_t{1} << 50);
  limits.memory_bytes = options.memory_bytes != 0 ? options.memory_bytes : std::min(by_size, limits.memory_most_bytes);
  const uint64_t seconds = options.seconds != 0 ? options.seconds : base_seconds + file_bytes / mebibyte;
  limits.seconds = static_cast<uint32_t>(std::min<uint64_t>(seconds, 1000000));
  return limits;
}

std::vector<std::string> load_file(Scene& scene, const std::filesystem::path& path, const glm::dmat4& root_to_world,
                                   const LoadOptions& options, const std::string& name) {
  const std::string shown = name.empty() ? path.string() : name;
  check_affine(root_to_world, "root_to_world");
  ImportAnswer answer;
  try {
    answer = read(path, root_to_world, options);
  } catch (const ks::Error& error) {
    // An invalid argument to Scene is an invalid file here.
    const bool content = error.status() == KS_ERROR_INVALID_ARGUMENT;
    ks::fail(content ? KS_ERROR_FILE : error.status(), "%s: %s", shown.c_str(), error.what());
  }
  std::ranges::move(show_transparent(answer.scene, options.keep_transparent), std::back_inserter(answer.warnings));
  std::ranges::move(without_area(answer.scene), std::back_inserter(answer.warnings));
  for (std::string& warning : answer.warnings) warning = shown + ": " + warning;
  scene.append(std::move(answer.scene));
  return std::move(answer.warnings);
}

}  // namespace kuafu
