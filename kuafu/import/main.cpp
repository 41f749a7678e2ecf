// SPDX-License-Identifier: Apache-2.0
// The helper programs kuafu-import-gltf, kuafu-import-mesh and kuafu-import-assimp: read one scene file and answer with its content on file
// descriptor 3 (io/wire.h). libkuafu starts them (io/import_process.h); they are of no use by hand. Arguments: path, memory at the start,
// most memory (bytes), seconds of processor time, 1 if files outside the scene's folder may be read, the number of the process that wants
// it, and the 16 numbers of root_to_world, by columns.
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <stdexcept>

#include "device/error.h"
#include "import/import.h"
#include "io/wire.h"

namespace {

constexpr int answer_fd = 3, argument_count = 7 + 16;

void set_limit(decltype(RLIMIT_CORE) what, rlim_t value, rlim_t more = 0) {
  rlimit limit{};
  if (getrlimit(what, &limit) != 0) return;
  limit.rlim_cur = std::min(value, limit.rlim_max);
  limit.rlim_max = std::min(value + more, limit.rlim_max);
  (void)setrlimit(what, &limit);
}

/// Gives up rights before the program looks at the file: it then cannot write files, leave core dumps, gain privileges or outlive its host.
/// False where the host has ended already.
bool confine(unsigned long seconds, pid_t host) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != host) return false;  // it ended before the line above
  prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
  std::signal(SIGPIPE, SIG_DFL);
  set_limit(RLIMIT_CORE, 0);
  set_limit(RLIMIT_FSIZE, 0);
  set_limit(RLIMIT_CPU, seconds, 1);  // SIGXCPU, and a second later SIGKILL
  return true;
}

void read(kuafu::Import& import) {
  kuafu::KUAFU_READER(import);
  const kuafu::Scene& scene = import.scene;
  if (scene.instances().empty() && scene.lights().empty() && scene.cameras().empty())
    ks::fail(KS_ERROR_FILE, "there is no mesh, light or camera in it%s%s", import.warnings.empty() ? "" : ": ",
             import.warnings.empty() ? "" : import.warnings.front().c_str());
  import.close_warnings();
}

void answer(std::FILE* to, char** argv) {
  kuafu::Budget budget(std::strtoull(argv[2], nullptr, 10), std::strtoull(argv[3], nullptr, 10));
  try {
    kuafu::SceneFolder folder(argv[1], argv[5][0] == '1', budget);
    kuafu::Import import(argv[1], folder, budget);
    for (int i = 0; i < 16; ++i) import.root_to_world[i / 4][i % 4] = std::strtod(argv[7 + i], nullptr);
    read(import);
    kuafu::write_answer(to, import.scene, import.warnings);
  } catch (const ks::Error& error) {
    kuafu::write_failure(to, error.status(), error.what());
  } catch (const std::bad_alloc&) {
    kuafu::write_failure(to, KS_ERROR_FILE,
                         "reading it takes more than the " + std::to_string(budget.limit_bytes() >> 20) +
                             " MiB of memory that files of this size may take: KUAFU_LOAD_MEMORY_MB allows more");
  } catch (const std::length_error&) {
    kuafu::write_failure(to, KS_ERROR_FILE, "a size in it is beyond all memory");
  } catch (const std::exception& error) {
    kuafu::write_failure(to, KS_ERROR_FILE, error.what());
  }
}

}  // namespace

int main(int argc, char** argv) {
  std::FILE* to = argc == argument_count ? fdopen(answer_fd, "wb") : nullptr;
  if (to == nullptr) return 2;  // not started by the library
  if (!confine(std::strtoul(argv[4], nullptr, 10), static_cast<pid_t>(std::strtol(argv[6], nullptr, 10)))) return 1;
  answer(to, argv);
  std::fclose(to);
  return 0;
}
