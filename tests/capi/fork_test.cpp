// SPDX-License-Identifier: Apache-2.0
// Forked children and threads that end in the middle.
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstring>

#include "capi/small_render.h"

namespace ks::test {
namespace {

class Fork : public EachTracer {};

TEST_P(Fork, AForkedChildMayReleaseAndIsToldWhatItCannotUse) {
  render.expect_works();
  const pid_t child = fork();
  if (child == 0) {
    alarm(60);
    const bool refused = render.render() == KS_ERROR_INVALID_STATE && std::strstr(kuafu_last_error(), "before fork") != nullptr;
    kuafu_buffer_release(render.buffer);
    kuafu_renderer_release(render.renderer);
    kuafu_scene_release(render.scene);
    kuafu_device_release(render.device);
    _exit(refused ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  render.expect_works();
}

INSTANTIATE_TEST_SUITE_P(Tracers, Fork, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

TEST(BufferImport, APipeOrASocketIsNoMemory) {
  const kuafu_device device = open_test_device<Kuafu>();
  SKIP_IF(device ? "" : kuafu_last_error());
  ks_device_info info = ks_device_info_init();
  ASSERT_EQ(kuafu_device_get_info(device, &info), KS_OK);
  int ends[2], sockets[2];
  ASSERT_EQ(pipe(ends), 0);
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM, 0, sockets), 0);
  for (const int fd : {ends[0], sockets[0]}) {
    ks_buffer_desc desc = ks_buffer_desc_init();
    desc.memory = KS_MEMORY_OPAQUE_FD;
    desc.handle = static_cast<uint64_t>(fd);
    desc.size_bytes = desc.allocation_bytes = 4096;
    std::memcpy(desc.device_uuid, info.device_uuid, sizeof desc.device_uuid);
    std::memcpy(desc.driver_uuid, info.driver_uuid, sizeof desc.driver_uuid);
    kuafu_buffer buffer = nullptr;
    EXPECT_EQ(kuafu_buffer_import(device, &desc, &buffer), KS_ERROR_INVALID_ARGUMENT);
    EXPECT_NE(std::strstr(kuafu_last_error(), "not memory"), nullptr) << kuafu_last_error();
  }
  for (const int fd : {ends[0], ends[1], sockets[0], sockets[1]}) close(fd);
  kuafu_device_release(device);
}

char render_marker = 0;  // what an ended thread returns the address of

/// A render that would take hours.
void* render_long(void* given) {
  auto* render = static_cast<SmallRender*>(given);
  render->desc.samples_per_pixel = 100000000;
  render->render();
  return nullptr;
}

class ThreadEnd : public EachTracer {};

TEST_P(ThreadEnd, ACancelledThreadLeavesTheRenderAndTheNextOneWorks) {
  pthread_t thread;
  ASSERT_EQ(pthread_create(&thread, nullptr, render_long, &render), 0);
  usleep(300000);
  ASSERT_EQ(pthread_cancel(thread), 0);
  void* result = nullptr;
  ASSERT_EQ(pthread_join(thread, &result), 0);
  EXPECT_EQ(result, PTHREAD_CANCELED);
  render.expect_works();
}

TEST_P(ThreadEnd, ACallbackMayEndItsThread) {
  render.desc.progress = [](void*, float) -> int32_t { pthread_exit(&render_marker); };
  pthread_t thread;
  ASSERT_EQ(pthread_create(&thread, nullptr, render_long, &render), 0);
  void* result = nullptr;
  ASSERT_EQ(pthread_join(thread, &result), 0);
  EXPECT_EQ(result, &render_marker);
  render.expect_works();
}

INSTANTIATE_TEST_SUITE_P(Tracers, ThreadEnd, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

}  // namespace
}  // namespace ks::test
