// SPDX-License-Identifier: Apache-2.0
#include "device/cache_file.h"

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>

namespace ks {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t most_bytes = 256ull << 20;  // a longer file is not one of ours

struct Header {
  char magic[8] = {'k', 's', 'c', 'a', 'c', 'h', 'e', '1'};
  uint64_t size_bytes = 0;
  uint64_t checksum = 0;
};

// FNV-1a, 64 bits (Fowler, Noll, Vo). Against accidents, not against adversaries: the folder is the user's own.
uint64_t checksum_of(std::span<const std::byte> bytes) {
  uint64_t hash = 0xcbf29ce484222325ull;
  for (const std::byte b : bytes) hash = (hash ^ uint64_t(b)) * 0x100000001b3ull;
  return hash;
}

/// A new empty file beside `file`; an empty path if none can be made.
fs::path new_file_beside(const fs::path& file) {
  std::string name = file.string() + ".XXXXXX";
  const int fd = mkstemp(name.data());
  if (fd < 0) return {};
  close(fd);
  return name;
}

bool write_whole(const fs::path& file, const Header& header, std::span<const std::byte> bytes) {
  std::ofstream out(file, std::ios::binary | std::ios::trunc);
  out.write(reinterpret_cast<const char*>(&header), sizeof header);
  out.write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  out.close();
  return bool(out);
}

}  // namespace

fs::path cache_folder(const char* asked) {
  if (asked != nullptr) return asked;
  const char* cache = std::getenv("XDG_CACHE_HOME");
  if (cache != nullptr && *cache == '/') return fs::path(cache) / "activestereo";  // the specification ignores relative ones
  const char* home = std::getenv("HOME");
  if (home != nullptr && *home == '/') return fs::path(home) / ".cache" / "activestereo";
  return {};
}

std::optional<std::vector<std::byte>> read_cache_file(const fs::path& file) {
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return std::nullopt;  // opening a pipe would wait
  std::ifstream in(file, std::ios::binary);
  const Header known;
  Header header;
  if (!in.read(reinterpret_cast<char*>(&header), sizeof header)) return std::nullopt;
  if (std::memcmp(header.magic, known.magic, sizeof known.magic) != 0 || header.size_bytes > most_bytes) return std::nullopt;
  if (fs::file_size(file, error) != sizeof header + header.size_bytes || error) return std::nullopt;
  std::vector<std::byte> bytes(header.size_bytes);
  if (!in.read(reinterpret_cast<char*>(bytes.data()), std::streamsize(bytes.size()))) return std::nullopt;
  if (checksum_of(bytes) != header.checksum) return std::nullopt;
  return bytes;
}

bool write_cache_file(const fs::path& file, std::span<const std::byte> bytes) {
  if (bytes.size() > most_bytes) return false;
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) return false;
  Header header;
  header.size_bytes = bytes.size();
  header.checksum = checksum_of(bytes);
  const fs::path part = new_file_beside(file);
  bool written = !part.empty() && write_whole(part, header, bytes);
  if (written) fs::rename(part, file, error);
  written = written && !error;
  if (!written && !part.empty()) fs::remove(part, error);
  return written;
}

}  // namespace ks
