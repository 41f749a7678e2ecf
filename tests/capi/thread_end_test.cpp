// SPDX-License-Identifier: Apache-2.0
// The end of a thread in the middle of the libraries' work: a host that cancels threads, or ends one from a callback, goes on.
#include <gtest/gtest.h>
#include <pthread.h>
#include <unistd.h>

#include "capi/small_render.h"

namespace ks::test {
namespace {

char render_marker = 0;  // what an ended thread returns the address of

/// A render that would take hours.
void* render_long(void* given) {
  auto* render = static_cast<SmallRender*>(given);
  render->desc.samples_per_pixel = 100000000;
  kuafu_renderer_render(render->renderer, render->scene, &render->desc);
  return nullptr;
}

class ThreadEnd : public testing::TestWithParam<uint32_t> {};

TEST_P(ThreadEnd, ACancelledThreadLeavesTheRenderAndTheNextOneWorks) {
  SmallRender render(GetParam());
  SKIP_IF(render.device ? "" : kuafu_last_error());
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
  SmallRender render(GetParam());
  SKIP_IF(render.device ? "" : kuafu_last_error());
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
