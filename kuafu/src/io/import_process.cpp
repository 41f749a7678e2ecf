// SPDX-License-Identifier: Apache-2.0
#include "io/import_process.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <system_error>

#include "device/error.h"
#include "device/interrupt.h"

extern char** environ;

namespace kuafu {
namespace {

constexpr int answer_fd = 3;
constexpr size_t buffer_bytes = 1 << 16;
// A reader is stopped by its processor time. The clock stops one that waits; it is wider, for the processors may be busy with others.
constexpr int clock_per_processor_second = 4;
constexpr int milliseconds_between_wishes = 50;  // to end early

class SpawnSettings {
 public:
  SpawnSettings() {
    posix_spawn_file_actions_init(&files);
    posix_spawnattr_init(&attributes);
  }
  ~SpawnSettings() {
    posix_spawn_file_actions_destroy(&files);
    posix_spawnattr_destroy(&attributes);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
};

/// posix_spawn shares the host's memory until the program starts (as vfork does) and runs no code of the host: safe beside other threads.
pid_t start(const std::filesystem::path& program, const std::vector<std::string>& arguments, int answer) {
  SpawnSettings settings;
  // If `answer` is answer_fd already, this only keeps it open in the child.
  posix_spawn_file_actions_adddup2(&settings.files, answer, answer_fd);
  posix_spawn_file_actions_addopen(&settings.files, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&settings.files, 1, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addopen(&settings.files, 2, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_addclosefrom_np(&settings.files, answer_fd + 1);
  sigset_t all, nothing;
  sigfillset(&all);
  sigemptyset(&nothing);
  posix_spawnattr_setsigdefault(&settings.attributes, &all);
  posix_spawnattr_setsigmask(&settings.attributes, &nothing);
  // A group of its own: Ctrl-C in a terminal is the host's to handle.
  posix_spawnattr_setpgroup(&settings.attributes, 0);
  posix_spawnattr_setflags(&settings.attributes, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_t child = -1;
  const int error = posix_spawn(&child, program.c_str(), &settings.files, &settings.attributes, argv.data(), environ);
  if (error != 0) ks::fail(KS_ERROR_FILE, "the program that reads it, %s, cannot be started: %s", program.c_str(), std::strerror(error));
  return child;
}

/// Waits for the end. Returns waitpid's status, or -1 where the host took it first (it ignores SIGCHLD or waits for any child).
int wait_for(pid_t child) {
  int status = 0;
  pid_t ended;
  do ended = waitpid(child, &status, 0);
  while (ended < 0 && errno == EINTR);
  return ended < 0 ? -1 : status;
}

/// Waits for the end of a child that closed its pipe, which is about to end; one that does not is ended. Returns as wait_for.
int wait_soon_for(pid_t child) {
  constexpr int rounds = 200;
  constexpr timespec ten_milliseconds{.tv_sec = 0, .tv_nsec = 10'000'000};
  for (int i = 0; i < rounds; ++i) {
    int status = 0;
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child) return status;
    if (ended < 0 && errno != EINTR) return -1;
    nanosleep(&ten_milliseconds, nullptr);
  }
  kill(child, SIGKILL);
  return wait_for(child);
}

std::filesystem::path own_folder() {
  Dl_info info{};
  if (dladdr(reinterpret_cast<const void*>(&find_helper), &info) == 0 || info.dli_fname == nullptr) return {};
  std::error_code error;
  const std::filesystem::path file = std::filesystem::canonical(info.dli_fname, error);
  if (!error) return file.parent_path();
  // A program that links this code in may know itself by the name it was called by.
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", error);
  return error ? std::filesystem::path() : self.parent_path();
}

}  // namespace

std::filesystem::path find_helper(const std::string& name, const std::filesystem::path& folder) {
  if (!folder.empty()) {
    if (access((folder / name).c_str(), X_OK) == 0) return folder / name;
    ks::fail(KS_ERROR_FILE, "the program that reads it, %s, is not in %s, which KUAFU_HELPERS names", name.c_str(), folder.c_str());
  }
  const std::filesystem::path own = own_folder();
  for (const char* place : {"", "../bin", "../libexec/kuafu", "kuafu"}) {
    const std::filesystem::path program = own / place / name;
    if (access(program.c_str(), X_OK) == 0) return program;
  }
  ks::fail(KS_ERROR_FILE,
           "the program that reads it, %s, is not beside the library (%s) nor in ../bin, ../libexec/kuafu or kuafu from there: install it, "
           "or name its folder by KUAFU_HELPERS",
           name.c_str(), own.c_str());
}

ImportProcess::ImportProcess(const std::filesystem::path& program, const std::vector<std::string>& arguments, uint32_t seconds)
    : seconds_(seconds), buffer_(buffer_bytes) {
  std::array<int, 2> ends{};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) ks::fail(KS_ERROR_FILE, "no pipe to the program that reads it: %s", std::strerror(errno));
  pipe_ = ends[0];
  deadline_ = std::chrono::steady_clock::now() + std::chrono::seconds(uint64_t{seconds} * clock_per_processor_second);
  try {
    child_ = start(program, arguments, ends[1]);
  } catch (...) {
    close(ends[0]);
    close(ends[1]);
    throw;
  }
  close(ends[1]);
}

ImportProcess::~ImportProcess() {
  close(pipe_);
  if (child_ < 0) return;
  kill(child_, SIGKILL);
  wait_for(child_);
}

void ImportProcess::read(void* to, size_t size_bytes) {
  auto* out = static_cast<unsigned char*>(to);
  while (size_bytes > 0) {
    if (begin_ == end_) fill();
    const size_t part = std::min(size_bytes, end_ - begin_);
    std::memcpy(out, buffer_.data() + begin_, part);
    begin_ += part;
    out += part;
    size_bytes -= part;
  }
}

void ImportProcess::fill() {
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline_ - std::chrono::steady_clock::now()).count();
    if (left <= 0)
      ks::fail(KS_ERROR_FILE, "reading it was stopped after %u s: if the file is to be trusted, allow more by KUAFU_LOAD_SECONDS",
               seconds_ * clock_per_processor_second);
    pollfd wait{.fd = pipe_, .events = POLLIN, .revents = 0};
    const int ready = poll(&wait, 1, static_cast<int>(std::min<long long>(left, milliseconds_between_wishes)));
    ks::interruption_point();
    if (ready == 0 || (ready < 0 && errno == EINTR)) continue;
    const ssize_t size = ready < 0 ? -1 : ::read(pipe_, buffer_.data(), buffer_.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) ks::fail(KS_ERROR_FILE, "the pipe to the program that reads it broke: %s", std::strerror(errno));
    if (size == 0) fail_ended();
    begin_ = 0;
    end_ = static_cast<size_t>(size);
    return;
  }
}

void ImportProcess::fail_ended() {
  const int status = wait_soon_for(child_);
  child_ = -1;
  if (status >= 0 && WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
    ks::fail(KS_ERROR_FILE,
             "reading it took more than %u s of processor time and was stopped: if the file is to be trusted, allow more by "
             "KUAFU_LOAD_SECONDS",
             seconds_);
  if (status >= 0 && WIFSIGNALED(status))
    ks::fail(KS_ERROR_FILE, "the program that reads it was ended by signal %d (%s): the file is broken, or too large for this machine",
             WTERMSIG(status), strsignal(WTERMSIG(status)));
  if (status >= 0 && WIFEXITED(status) && WEXITSTATUS(status) == 127)
    ks::fail(KS_ERROR_FILE, "the program that reads it does not start: a shared library that it needs is missing (ldd names it)");
  ks::fail(KS_ERROR_FILE, "the program that reads it ended with status %d before it was done: the file is broken",
           status >= 0 && WIFEXITED(status) ? WEXITSTATUS(status) : -1);
}

}  // namespace kuafu
