// SPDX-License-Identifier: Apache-2.0
// Renders that their caller does not wait for: two under way, a wait that gives up in time, and cancel from anywhere.
#include <gtest/gtest.h>

#include <cstring>
#include <map>
#include <memory>
#include <thread>
#include <vector>

#include "capi/small_render.h"

namespace ks::test {
namespace {

constexpr uint64_t forever = UINT64_MAX, millisecond = 1000000;
constexpr uint32_t hours = 100000000;  // samples

/// One of each tracer for all tests, which leave it at rest: its shaders are compiled once.
SmallRender& shared_render(uint32_t tracer) {
  static std::map<uint32_t, std::unique_ptr<SmallRender>> kept;
  std::unique_ptr<SmallRender>& render = kept[tracer];
  if (!render || render->renderer == nullptr) render = std::make_unique<SmallRender>(tracer);
  return *render;
}

class Submit : public testing::TestWithParam<uint32_t> {
 protected:
  SmallRender& render = shared_render(GetParam());
  void SetUp() override {
    SKIP_IF(render.device ? "" : kuafu_last_error());
    render.desc.seed = 0;
    render.expect_works();
  }
  ks_sync submit(uint32_t samples, uint64_t seed = 0) {
    render.desc.samples_per_pixel = samples;
    render.desc.seed = seed;
    ks_sync sync = ks_sync_init();
    EXPECT_EQ(kuafu_renderer_submit(render.renderer, render.scene, &render.desc, &sync), KS_OK) << kuafu_last_error();
    return sync;
  }
  ks_status wait(const ks_sync& sync, uint64_t timeout_ns = forever) { return kuafu_renderer_wait(render.renderer, &sync, timeout_ns); }
  std::vector<float> image() {
    std::vector<float> out(64 * 64);
    EXPECT_EQ(kuafu_buffer_read(render.buffer, 0, out.data(), out.size() * 4), KS_OK);
    return out;
  }
};

TEST_P(Submit, GivesTheBitsOfARenderThatWasWaitedFor) {
  render.desc.samples_per_pixel = 4, render.desc.seed = 7;
  ASSERT_EQ(kuafu_renderer_render(render.renderer, render.scene, &render.desc), KS_OK);
  const std::vector<float> expected = image();
  ASSERT_EQ(wait(submit(1)), KS_OK);
  EXPECT_NE(image(), expected);
  ASSERT_EQ(wait(submit(4, 7)), KS_OK) << kuafu_last_error();
  EXPECT_EQ(image(), expected);
  kuafu_render_summary summary = kuafu_render_summary_init();
  ASSERT_EQ(kuafu_renderer_get_summary(render.renderer, &summary), KS_OK);
  EXPECT_EQ(summary.samples_per_pixel, 4u);
}

TEST_P(Submit, ASecondCallIsRefusedWhileOneIsUnderWay) {
  struct Second {
    SmallRender& render;
    ks_status change = KS_OK, drawn = KS_OK;
  } second{render};
  kuafu_render_desc desc = render.desc;
  desc.progress_user = &second;
  desc.progress = [](void* user, float) -> int32_t {
    Second& other = *static_cast<Second*>(user);
    std::thread([&] {
      other.change = kuafu_scene_next_frame(other.render.scene);
      other.drawn = kuafu_renderer_render(other.render.renderer, other.render.scene, &other.render.desc);
    }).join();
    return 0;
  };
  ASSERT_EQ(kuafu_renderer_render(render.renderer, render.scene, &desc), KS_OK) << kuafu_last_error();
  EXPECT_EQ(second.change, KS_ERROR_INVALID_STATE);
  EXPECT_EQ(second.drawn, KS_ERROR_INVALID_STATE);
  render.expect_works();
}

TEST_P(Submit, AWaitGivesUpInTimeAndTheRenderGoesOnUntilItIsCancelled) {
  const ks_sync sync = submit(hours);
  EXPECT_EQ(wait(sync, 0), KS_ERROR_TIMEOUT);
  EXPECT_NE(std::strstr(kuafu_last_error(), "goes on"), nullptr) << kuafu_last_error();
  EXPECT_EQ(wait(sync, 20 * millisecond), KS_ERROR_TIMEOUT);
  EXPECT_EQ(kuafu_renderer_cancel(render.renderer), KS_OK);
  EXPECT_EQ(wait(sync), KS_ERROR_CANCELLED) << kuafu_last_error();
  EXPECT_EQ(wait(sync, 0), KS_ERROR_CANCELLED) << "an outcome can be asked for again";
  render.expect_works();
}

TEST_P(Submit, TwoAreUnderWayAndEndInTheirOrder) {
  const ks_sync first = submit(2, 1), second = submit(2, 2);
  EXPECT_EQ(first.kind, KS_SYNC_TIMELINE);
  EXPECT_LT(first.value, second.value);
  EXPECT_EQ(wait(second), KS_OK) << kuafu_last_error();
  EXPECT_EQ(wait(first, 0), KS_OK) << "it came before";
  const std::vector<float> last = image();
  render.desc.samples_per_pixel = 2, render.desc.seed = 2;
  ASSERT_EQ(kuafu_renderer_render(render.renderer, render.scene, &render.desc), KS_OK);
  EXPECT_EQ(image(), last);
}

TEST_P(Submit, CancelEndsAllThatIsUnderWayAndNothingLater) {
  const ks_sync first = submit(hours), second = submit(hours);
  std::thread([&] { EXPECT_EQ(kuafu_renderer_cancel(render.renderer), KS_OK); }).join();
  const ks_sync third = submit(1);
  EXPECT_EQ(wait(second), KS_ERROR_CANCELLED);
  EXPECT_EQ(wait(third), KS_OK) << kuafu_last_error();
  EXPECT_EQ(wait(first), KS_ERROR_INVALID_ARGUMENT) << "two later submissions have taken its place";
}

TEST_P(Submit, CancelEndsARenderThatAnotherThreadWaitsIn) {
  render.desc.samples_per_pixel = hours;
  ks_status status = KS_OK;
  std::thread other([&] { status = kuafu_renderer_render(render.renderer, render.scene, &render.desc); });
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  EXPECT_EQ(kuafu_renderer_cancel(render.renderer), KS_OK);
  other.join();
  EXPECT_EQ(status, KS_ERROR_CANCELLED);
}

TEST_P(Submit, ASceneThatIsReadCannotBeChanged) {
  const ks_sync sync = submit(hours);
  EXPECT_EQ(kuafu_scene_next_frame(render.scene), KS_ERROR_INVALID_STATE);
  EXPECT_NE(std::strstr(kuafu_last_error(), "wait for them"), nullptr) << kuafu_last_error();
  kuafu_scene_summary summary = kuafu_scene_summary_init();
  EXPECT_EQ(kuafu_scene_get_summary(render.scene, &summary), KS_OK) << "reading is no change";
  EXPECT_EQ(kuafu_renderer_cancel(render.renderer), KS_OK);
  EXPECT_EQ(wait(sync), KS_ERROR_CANCELLED);
  EXPECT_EQ(kuafu_scene_next_frame(render.scene), KS_OK) << kuafu_last_error();
}

TEST_P(Submit, ARendererIsReleasedInTheMiddle) {
  (void)submit(hours), (void)submit(hours);
  kuafu_renderer_release(render.renderer);
  render.renderer = nullptr;
  EXPECT_EQ(kuafu_scene_next_frame(render.scene), KS_OK) << kuafu_last_error();
}

TEST_P(Submit, WhatWasNeverSubmittedCannotBeWaitedFor) {
  ks_sync sync = ks_sync_init();
  sync.kind = KS_SYNC_TIMELINE;
  for (const uint64_t value : {uint64_t{0}, uint64_t{1}, UINT64_MAX}) {
    sync.value = value;
    EXPECT_EQ(wait(sync), KS_ERROR_INVALID_ARGUMENT) << value;
  }
  sync.kind = KS_SYNC_HOST;
  EXPECT_EQ(wait(sync), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(kuafu_renderer_wait(render.renderer, nullptr, 0), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(kuafu_renderer_submit(render.renderer, render.scene, &render.desc, nullptr), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(kuafu_renderer_cancel(nullptr), KS_ERROR_INVALID_ARGUMENT);
}

INSTANTIATE_TEST_SUITE_P(Tracers, Submit, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

}  // namespace
}  // namespace ks::test
