// SPDX-License-Identifier: Apache-2.0
#include "import/scene_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <climits>
#include <cstring>

#include "device/error.h"

namespace kuafu {
namespace {

class OpenFile {
 public:
  // Not blocking: to open a FIFO would wait for a writer. It has no effect on regular files.
  explicit OpenFile(const std::filesystem::path& path) : fd_(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY)) {}
  ~OpenFile() {
    if (fd_ >= 0) close(fd_);
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  [[nodiscard]] int fd() const { return fd_; }

 private:
  int fd_;
};

FileContent read_regular_file(const std::filesystem::path& path, const std::string& name) {
  const OpenFile file(path);
  if (file.fd() < 0) ks::fail(KS_ERROR_FILE, "cannot open '%s': %s", name.c_str(), std::strerror(errno));
  struct stat status {};
  if (fstat(file.fd(), &status) != 0) ks::fail(KS_ERROR_FILE, "cannot read '%s': %s", name.c_str(), std::strerror(errno));
  if (!S_ISREG(status.st_mode)) ks::fail(KS_ERROR_FILE, "'%s' is not a regular file", name.c_str());
  if (status.st_size == 0) ks::fail(KS_ERROR_FILE, "'%s' is empty", name.c_str());
  std::vector<uint8_t> bytes(static_cast<size_t>(status.st_size));
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t part = ::read(file.fd(), bytes.data() + at, bytes.size() - at);
    if (part < 0 && errno == EINTR) continue;
    if (part <= 0)
      ks::fail(KS_ERROR_FILE, "cannot read the %zu bytes of '%s': %s", bytes.size(), name.c_str(),
               part < 0 ? std::strerror(errno) : "it became shorter");
    at += static_cast<size_t>(part);
  }
  return {std::move(bytes), {status.st_dev, status.st_ino}};
}

bool is_inside(const std::filesystem::path& path, const std::filesystem::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end();
}

bool same_letters(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

/// The path of `name` below `folder` where upper and lower case count as one, by the first of several alike; none: it is not there.
std::optional<std::filesystem::path> in_any_case(const std::filesystem::path& folder, const std::filesystem::path& name) {
  std::filesystem::path at = folder;
  for (const std::filesystem::path& part : name) {
    std::error_code error;
    if (std::filesystem::exists(at / part, error)) {
      at /= part;
      continue;
    }
    std::optional<std::filesystem::path> first;
    for (const auto& entry : std::filesystem::directory_iterator(at, error)) {
      const std::filesystem::path found = entry.path().filename();
      if (same_letters(found.native(), part.native()) && (!first || found < *first)) first = found;
    }
    if (!first) return std::nullopt;
    at /= *first;
  }
  return at;
}

/// How else a name may be meant: quotes, blanks around it and backslashes are how Windows' programs write it. A path from the root of
/// another machine is each of its endings, the longest first.
std::vector<std::filesystem::path> other_readings(std::string name) {
  if (name.size() >= PATH_MAX) return {};
  constexpr const char* around = " \t\r\n\"'";
  name.erase(name.find_last_not_of(around) + 1);
  name.erase(0, name.find_first_not_of(around));
  std::replace(name.begin(), name.end(), '\\', '/');
  if (name.starts_with("file:")) name.erase(0, 5);
  const size_t root = name.size() > 1 && name[1] == ':' ? 2 : 0;
  const bool absolute = root > 0 || name.starts_with('/');
  std::filesystem::path rest = std::filesystem::path(name.substr(root)).lexically_normal().relative_path();
  std::vector<std::filesystem::path> out;
  while (!rest.empty()) {
    out.push_back(rest);
    if (!absolute) break;
    rest = rest.lexically_relative(*rest.begin());
    if (rest == ".") break;
  }
  return out;
}

}  // namespace

std::vector<uint8_t> SceneFolder::counted(FileContent&& content) const {
  if (seen_.insert(content.identity).second) budget_.add_file(content.bytes.size());
  return std::move(content.bytes);
}

SceneFolder::SceneFolder(const std::filesystem::path& scene_file, bool outside, Budget& budget)
    : scene_file_(scene_file), outside_(outside), budget_(budget) {
  folder_ = std::filesystem::absolute(scene_file).parent_path();
  std::error_code error;
  canonical_folder_ = std::filesystem::canonical(folder_, error);
  if (error) ks::fail(KS_ERROR_FILE, "its folder cannot be read: %s", error.message().c_str());
}

std::vector<uint8_t> SceneFolder::read_scene_file() const {
  return counted(read_regular_file(scene_file_, scene_file_.filename().string()));
}

std::optional<std::filesystem::path> SceneFolder::inside(const std::filesystem::path& path) const {
  std::error_code error;
  std::filesystem::path there = std::filesystem::canonical(path, error);
  return !error && (outside_ || is_inside(there, canonical_folder_)) ? std::optional(std::move(there)) : std::nullopt;
}

std::filesystem::path SceneFolder::resolve(const std::string& name) const {
  if (name.find('\0') != std::string::npos) ks::fail(KS_ERROR_FILE, "a file's name has a zero byte: '%s'", name.c_str());
  if (const auto path = inside(folder_ / name)) return *path;
  for (const std::filesystem::path& reading : other_readings(name)) {
    if (!outside_ && *reading.begin() == "..") continue;
    const auto found = in_any_case(canonical_folder_, reading);
    if (const auto path = found ? inside(*found) : std::nullopt) return *path;
  }
  std::error_code error;
  (void)std::filesystem::canonical(folder_ / name, error);
  // The same words whether it exists or not: a scene file must not find out what is elsewhere.
  if (!outside_ && (!error || !is_inside((folder_ / name).lexically_normal(), folder_.lexically_normal())))
    ks::fail(KS_ERROR_FILE, "'%s' is outside the scene file's folder: if the file is to be trusted, set KUAFU_LOAD_OUTSIDE=1",
             name.c_str());
  ks::fail(KS_ERROR_FILE, "cannot open '%s': %s", name.c_str(), error.message().c_str());
}

std::vector<uint8_t> SceneFolder::read(const std::string& name) const { return counted(read_regular_file(resolve(name), name)); }

}  // namespace kuafu
