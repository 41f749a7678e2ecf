// SPDX-License-Identifier: Apache-2.0
// A reader of scene files in a process of its own, so that no file can take the host down: whatever the reader does with a broken or
// hostile file (it crashes, runs forever, takes all memory) ends in one error here. The programs are kuafu-import-gltf,
// kuafu-import-mesh and kuafu-import-assimp, built from kuafu/import. Thread rule: one object belongs to one thread; any number of threads
// may have their own.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <string>
#include <vector>

namespace kuafu {

/// Returns the path of a helper program: in `folder` if given, else beside this library, or in ../bin, ../libexec/kuafu or kuafu/ from
/// there. Throws KS_ERROR_FILE with the places.
std::filesystem::path find_helper(const std::string& name, const std::filesystem::path& folder);

class ImportProcess {
 public:
  /// Starts the helper in the host's working directory. Of the host's open files it inherits only the pipe for its answer.
  ImportProcess(const std::filesystem::path& program, const std::vector<std::string>& arguments, uint32_t seconds);
  /// Ends the process if it still runs.
  ~ImportProcess();
  ImportProcess(const ImportProcess&) = delete;
  ImportProcess& operator=(const ImportProcess&) = delete;

  /// Reads the next bytes of the answer. Throws KS_ERROR_FILE after the last byte or when the time is up; the text says how the process
  /// ended.
  void read(void* to, size_t size_bytes);

 private:
  void fill();
  [[noreturn]] void fail_ended();

  pid_t child_ = -1;
  int pipe_ = -1;
  uint32_t seconds_;
  std::chrono::steady_clock::time_point deadline_;
  std::vector<unsigned char> buffer_;
  size_t begin_ = 0, end_ = 0;  // of what is in the buffer
};

}  // namespace kuafu
