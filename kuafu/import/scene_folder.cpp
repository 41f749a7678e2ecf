// SPDX-License-Identifier: Apache-2.0
#include "import/scene_folder.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
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

std::filesystem::path SceneFolder::resolve(const std::string& name) const {
  if (name.find('\0') != std::string::npos) ks::fail(KS_ERROR_FILE, "a file's name has a zero byte: '%s'", name.c_str());
  std::error_code error;
  std::filesystem::path path = std::filesystem::canonical(folder_ / name, error);
  // The same words whether it exists or not: a scene file must not find out what is elsewhere.
  const bool inside = is_inside(error ? (folder_ / name).lexically_normal() : path, error ? folder_.lexically_normal() : canonical_folder_);
  if (!outside_ && !inside)
    ks::fail(KS_ERROR_FILE, "'%s' is outside the scene file's folder: if the file is to be trusted, set KUAFU_LOAD_OUTSIDE=1",
             name.c_str());
  if (error) ks::fail(KS_ERROR_FILE, "cannot open '%s': %s", name.c_str(), error.message().c_str());
  return path;
}

std::vector<uint8_t> SceneFolder::read(const std::string& name) const { return counted(read_regular_file(resolve(name), name)); }

}  // namespace kuafu
