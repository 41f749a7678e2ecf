// SPDX-License-Identifier: Apache-2.0
// Files of the user's cache folder: bytes that are nice to have. A file that is missing, cut short or altered reads as nothing; one that
// cannot be written is not. Thread rule: any threads and processes at once; the last writer of a file wins, and no reader sees half of it.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

namespace ks {

/// Returns the folder for cache files: `asked`, or for NULL $XDG_CACHE_HOME/activestereo, else $HOME/.cache/activestereo. Empty: nothing is
/// cached.
std::filesystem::path cache_folder(const char* asked);

std::optional<std::vector<std::byte>> read_cache_file(const std::filesystem::path& file);
/// Writes a cache file and makes its folders. Returns false if writing failed; the former file is then unchanged.
bool write_cache_file(const std::filesystem::path& file, std::span<const std::byte> bytes);

}  // namespace ks
