// SPDX-License-Identifier: Apache-2.0
#include "io/load_options.h"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <cstring>

#include "device/error.h"
#include "device/host_memory.h"

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

}  // namespace kuafu
