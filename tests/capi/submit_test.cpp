// SPDX-License-Identifier: Apache-2.0
// Renders that are submitted, waited for and cancelled.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "capi/small_match.h"
#include "capi/small_render.h"

namespace ks::test {
namespace {

using Clock = std::chrono::steady_clock;

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
};

TEST_P(Submit, GivesTheBitsOfARenderThatWasWaitedFor) {
  render.desc.samples_per_pixel = 4, render.desc.seed = 7;
  ASSERT_EQ(render.render(), KS_OK);
  const std::vector<float> expected = render.image();
  ASSERT_EQ(wait(submit(1)), KS_OK);
  EXPECT_NE(render.image(), expected);
  ASSERT_EQ(wait(submit(4, 7)), KS_OK) << kuafu_last_error();
  EXPECT_EQ(render.image(), expected);
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
      other.drawn = other.render.render();
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
  const std::vector<float> last = render.image();
  render.desc.samples_per_pixel = 2, render.desc.seed = 2;
  ASSERT_EQ(render.render(), KS_OK);
  EXPECT_EQ(render.image(), last);
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
  std::thread other([&] { status = render.render(); });
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
}

INSTANTIATE_TEST_SUITE_P(Tracers, Submit, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

// Against the hours that the render would take: bench_cancel measures how soon the end comes, and a busy machine may be late here.
constexpr double most_seconds = 20.0;

/// Renders for hours, and wishes the end so long after the start. Seconds from the wish to the end.
double seconds_to_the_end(SmallRender& render, int delay_ms) {
  std::atomic<bool> wish{false};
  Clock::time_point wished;
  render.desc.samples_per_pixel = 100000000;
  render.desc.progress = [](void* wanted, float) -> int32_t { return static_cast<std::atomic<bool>*>(wanted)->load() ? 1 : 0; };
  render.desc.progress_user = &wish;
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms));
    wished = Clock::now();
    wish = true;
  });
  EXPECT_EQ(render.render(), KS_ERROR_CANCELLED) << kuafu_last_error();
  const Clock::time_point end = Clock::now();
  other.join();
  return std::chrono::duration<double>(end - wished).count();
}

/// Adds a sheet of 2 * side^2 triangles.
void add_sheet(kuafu_scene scene, uint32_t side) {
  std::vector<float> positions;
  std::vector<uint32_t> indices;
  for (uint32_t y = 0; y <= side; ++y)
    for (uint32_t x = 0; x <= side; ++x) positions.insert(positions.end(), {float(x), float(y), std::sin(float(x * y))});
  for (uint32_t y = 0; y < side; ++y)
    for (uint32_t x = 0; x < side; ++x) {
      const uint32_t a = y * (side + 1) + x, b = a + side + 1;
      indices.insert(indices.end(), {a, a + 1, b, b, a + 1, b + 1});
    }
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.positions = positions.data(), mesh.vertex_count = static_cast<uint32_t>(positions.size() / 3);
  mesh.indices = indices.data(), mesh.triangle_count = static_cast<uint32_t>(indices.size() / 3);
  uint32_t id = 0;
  kuafu_instance_desc instance = kuafu_instance_desc_init(1);
  ASSERT_EQ(kuafu_scene_add_mesh(scene, &mesh, &instance.mesh), KS_OK) << kuafu_last_error();
  ASSERT_EQ(kuafu_scene_add_instance(scene, &instance, &id), KS_OK) << kuafu_last_error();
}

class Cancel : public EachTracer {};

TEST_P(Cancel, TheFirstRenderEndsSoonAndTheNextOneWorks) {
  EXPECT_LT(seconds_to_the_end(render, 100), most_seconds);  // in compute, while lavapipe compiles
  render.expect_works();
  EXPECT_LT(seconds_to_the_end(render, 100), most_seconds);
}

TEST_P(Cancel, TheTreeOfALargeMeshEndsSoonAndTheNextRenderWorks) {
  render.expect_works();
  add_sheet(render.scene, 500);
  EXPECT_LT(seconds_to_the_end(render, 100), most_seconds);
  render.expect_works();
}

// While a tree is built, the callback is asked again and again, from the caller's own thread: Python's Ctrl-C is heard there.
TEST_P(Cancel, TheCallbackIsAskedInTheCallersThreadAlsoWhileATreeIsBuilt) {
  render.expect_works();
  add_sheet(render.scene, 500);
  struct Heard {
    std::thread::id caller = std::this_thread::get_id();
    int count = 0, elsewhere = 0;
    float last = 0;
    bool falls = false;
  } heard;
  render.desc.progress = [](void* user, float fraction) -> int32_t {
    auto* h = static_cast<Heard*>(user);
    ++h->count;
    if (std::this_thread::get_id() != h->caller) ++h->elsewhere;
    h->falls |= fraction < h->last;
    h->last = fraction;
    return 0;
  };
  render.desc.progress_user = &heard;
  ASSERT_EQ(render.render(), KS_OK) << kuafu_last_error();
  EXPECT_GE(heard.count, 2);
  EXPECT_EQ(heard.elsewhere, 0);
  EXPECT_FALSE(heard.falls);
  EXPECT_EQ(heard.last, 1.0f);
}

INSTANTIATE_TEST_SUITE_P(Tracers, Cancel, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

/// A folder with a helper program that never answers, which loads use while it lives.
struct SleepingHelper {
  std::filesystem::path folder;
  SleepingHelper() {
    std::string name = (std::filesystem::temp_directory_path() / "ks_helper_XXXXXX").string();
    folder = mkdtemp(name.data());
    std::ofstream(folder / "kuafu-import-gltf") << "#!/bin/sh\nexec sleep 600\n";
    std::filesystem::permissions(folder / "kuafu-import-gltf", std::filesystem::perms::owner_all);
    std::ofstream(folder / "a.gltf") << "{}";
    setenv("KUAFU_HELPERS", folder.c_str(), 1);
  }
  ~SleepingHelper() {
    unsetenv("KUAFU_HELPERS");
    std::filesystem::remove_all(folder);
  }
  SleepingHelper(const SleepingHelper&) = delete;
  SleepingHelper& operator=(const SleepingHelper&) = delete;
};

TEST(CancelOfALoad, EndsItSoonAndLeavesTheSceneAsItWas) {
  SmallRender render(KUAFU_TRACER_EMBREE);
  SKIP_IF(render.device ? "" : kuafu_last_error());
  const SleepingHelper helper;
  Clock::time_point wished;
  std::thread other([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
    wished = Clock::now();
    EXPECT_EQ(kuafu_scene_cancel_load(render.scene), KS_OK);
  });
  EXPECT_EQ(kuafu_scene_load(render.scene, (helper.folder / "a.gltf").c_str(), nullptr, nullptr), KS_ERROR_CANCELLED) << kuafu_last_error();
  const double seconds = std::chrono::duration<double>(Clock::now() - wished).count();
  other.join();
  EXPECT_LT(seconds, 60.0) << "it waited for the helper program";
  render.expect_works();
}

TEST(CancelOfSimsense, EndsAComputeOfAnotherThread) {
  SmallMatch work(open_host_device(), 5000);
  std::atomic<bool> begun{false};
  work.desc.progress = [](void* user, float) -> int32_t { return static_cast<std::atomic<bool>*>(user)->store(true), 0; };
  work.desc.progress_user = &begun;
  Clock::time_point wished;
  std::thread other([&] {
    while (!begun) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    wished = Clock::now();
    EXPECT_EQ(simsense_engine_cancel(work.engine), KS_OK);
  });
  EXPECT_EQ(simsense_engine_compute(work.engine, &work.desc), KS_ERROR_CANCELLED) << simsense_last_error();
  const double seconds = std::chrono::duration<double>(Clock::now() - wished).count();
  other.join();
  EXPECT_LT(seconds, 60.0);
  EXPECT_EQ(work.disparity.back(), 0.0f) << "the last pair was computed: nothing was cancelled";
}

TEST(CancelOfSimsense, WhatFollowsHasTheBitsOfAnEngineThatWasNeverCancelled) {
  SmallMatch cancelled(open_host_device(), 4), plain(open_host_device(), 4);
  int left = 5;  // while other threads work, the caller tells little
  cancelled.desc.progress = [](void* user, float) -> int32_t { return --*static_cast<int*>(user) < 0; };
  cancelled.desc.progress_user = &left;
  EXPECT_EQ(simsense_engine_compute(cancelled.engine, &cancelled.desc), KS_ERROR_CANCELLED);
  EXPECT_NE(std::string(simsense_last_error()).find(" of 4"), std::string::npos) << simsense_last_error();
  cancelled.desc.progress = nullptr;
  EXPECT_EQ(simsense_engine_compute(cancelled.engine, &cancelled.desc), KS_OK) << simsense_last_error();
  EXPECT_EQ(simsense_engine_compute(plain.engine, &plain.desc), KS_OK) << simsense_last_error();
  EXPECT_EQ(cancelled.disparity, plain.disparity);
}

}  // namespace
}  // namespace ks::test
