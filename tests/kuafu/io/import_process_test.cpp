// SPDX-License-Identifier: Apache-2.0
// The host's side of a helper program: whatever the helper does, the host gets an answer or one error.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "capi/device/expect_error.h"
#include "device/error.h"
#include "io/load.h"
#include "io/wire.h"
#include "kuafu/io/sample_files.h"

namespace {

using namespace kuafu;
using namespace scene_test;

void write_glb(const std::filesystem::path& path) {
  GltfWriter w;
  w.thing();
  w.write_glb(path);
}

/// What load_file says when the helper is this shell script.
std::string error_with_helper(const std::string& script) {
  const Folder folder;
  write_glb(folder / "a.glb");
  write_text(folder / "kuafu-import-gltf", "#!/bin/sh\n" + script + "\n");
  chmod((folder / "kuafu-import-gltf").c_str(), 0700);
  Scene scene;
  try {
    load_file(scene, folder / "a.glb", glm::dmat4(1.0), {.seconds = 1, .helpers = folder / ""});
  } catch (const ks::Error& error) {
    return error.what();
  }
  return {};
}

bool has(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

TEST(ImportProcess, EveryEndOfTheHelperIsOneError) {
  EXPECT_TRUE(has(error_with_helper("exit 0"), "ended with status 0 before it was done"));
  EXPECT_TRUE(has(error_with_helper("exit 3"), "status 3"));
  EXPECT_TRUE(has(error_with_helper("kill -SEGV $$"), "signal 11"));
  EXPECT_TRUE(has(error_with_helper("exit 127"), "does not start"));
  EXPECT_TRUE(has(error_with_helper("echo hello there >&3"), "another version"));
  EXPECT_TRUE(has(error_with_helper("exec 3>&-; sleep 100"), "")) << "one that closes its pipe is not waited for";
}

TEST(ImportProcess, OneThatSleepsIsStopped) { EXPECT_TRUE(has(error_with_helper("exec sleep 100"), "stopped after 4 s")); }

TEST(ImportProcess, AMissingHelperIsNamed) {
  const Folder folder;
  write_glb(folder / "a.glb");
  Scene scene;
  const LoadOptions options{.helpers = folder / ""};
  EXPECT_ERROR(load_file(scene, folder / "a.glb", glm::dmat4(1.0), options), KS_ERROR_FILE, "kuafu-import-gltf");
}

TEST(ImportProcess, AHostThatIgnoresItsChildrenLoadsAllTheSame) {
  const Folder folder;
  write_glb(folder / "a.glb");
  const auto before = std::signal(SIGCHLD, SIG_IGN);
  Scene scene;
  EXPECT_NO_THROW(load_file(scene, folder / "a.glb", glm::dmat4(1.0)));
  std::signal(SIGCHLD, before);
}

TEST(ImportProcess, ThreadsLoadAtOnceAndLeaveNoChildAndNoFile) {
  const Folder folder;
  write_glb(folder / "a.glb");
  const auto open_files = [] {
    return std::distance(std::filesystem::directory_iterator("/proc/self/fd"), std::filesystem::directory_iterator());
  };
  const auto before = open_files();
  std::vector<std::thread> threads;
  for (int t = 0; t < 8; ++t)
    threads.emplace_back([&] {
      for (int i = 0; i < 5; ++i) {
        Scene scene;
        load_file(scene, folder / "a.glb", glm::dmat4(1.0));
        EXPECT_EQ(scene.meshes().size(), 1u);
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(open_files(), before);
  EXPECT_EQ(waitpid(-1, nullptr, WNOHANG), -1) << "a child was left";
}

TEST(ImportProcess, HostsFilesAreNotPassedOn) {
  int ends[2];
  ASSERT_EQ(pipe(ends), 0);  // without O_CLOEXEC, as hosts have them
  EXPECT_TRUE(has(
      error_with_helper(
          "for f in /proc/self/fd/*; do case $(basename $f) in [4-9]|1[0-9]) readlink $f | grep -q pipe: && exit 9;; esac; done; exit 5"),
      "status 5"));
  close(ends[0]), close(ends[1]);
}

}  // namespace
