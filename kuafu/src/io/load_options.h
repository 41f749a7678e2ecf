// SPDX-License-Identifier: Apache-2.0
// Limits of a scene file's cost and of the files that it may name. 0 = automatic.
#pragma once

#include <cstdint>
#include <filesystem>

namespace kuafu {

struct LoadOptions {
  /// Memory that reading may take. Automatic: 1 GiB and 64 times the bytes of the files read, at most half of the machine's memory.
  uint64_t memory_bytes = 0;
  /// Processor time that reading may take. Automatic: 30 s and 1 s per MiB of the scene file.
  uint32_t seconds = 0;
  /// Whether the file may name files outside its own folder (above it, elsewhere by absolute path, or behind a symbolic link).
  bool outside_folder = false;
  /// Whether materials of opacity 0 stay unseen (unseen.h).
  bool keep_transparent = false;
  /// Folder of the helper programs; empty: looked for beside the library (import_process.h).
  std::filesystem::path helpers;
};

/// Returns automatic options, except for variables that are set: KUAFU_LOAD_MEMORY_MB, KUAFU_LOAD_SECONDS, KUAFU_LOAD_OUTSIDE=1,
/// KUAFU_LOAD_TRANSPARENT=1, KUAFU_HELPERS. A process with raised privileges ignores them. Throws KS_ERROR_INVALID_ARGUMENT for an invalid
/// number.
LoadOptions load_options_from_environment();

/// The options for a scene file of a certain size, with automatic values filled in.
struct LoadLimits {
  uint64_t memory_bytes = 0;       // at the start
  uint64_t memory_most_bytes = 0;  // as files are read, it grows up to this
  uint32_t seconds = 0;
};
LoadLimits load_limits(const LoadOptions& options, uint64_t file_bytes);

/// Bytes of memory that each byte of a file read allows.
inline constexpr uint64_t memory_per_file_byte = 64;

}  // namespace kuafu
