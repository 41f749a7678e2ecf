// SPDX-License-Identifier: Apache-2.0
// A render ends soon after another thread's wish, in every phase and on every tracer. The bounds are for a busy machine;
// tests/bench/bench_cancel.cpp prints what it really takes.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <thread>
#include <vector>

#include "capi/small_render.h"

namespace ks::test {
namespace {

using Clock = std::chrono::steady_clock;

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
  EXPECT_EQ(kuafu_renderer_render(render.renderer, render.scene, &render.desc), KS_ERROR_CANCELLED) << kuafu_last_error();
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
  kuafu_instance_desc instance = kuafu_instance_desc_init(0);
  ASSERT_EQ(kuafu_scene_add_mesh(scene, &mesh, &instance.mesh), KS_OK) << kuafu_last_error();
  ASSERT_EQ(kuafu_scene_add_instance(scene, &instance, &id), KS_OK) << kuafu_last_error();
}

class Cancel : public testing::TestWithParam<uint32_t> {};

TEST_P(Cancel, TheFirstRenderEndsSoonAndTheNextOneWorks) {
  SmallRender render(GetParam());
  SKIP_IF(render.device ? "" : kuafu_last_error());
  EXPECT_LT(seconds_to_the_end(render, 100), most_seconds);  // in compute, while lavapipe compiles
  render.expect_works();
  EXPECT_LT(seconds_to_the_end(render, 100), most_seconds);
}

TEST_P(Cancel, TheTreeOfALargeMeshEndsSoonAndTheNextRenderWorks) {
  SmallRender render(GetParam());
  SKIP_IF(render.device ? "" : kuafu_last_error());
  render.expect_works();
  add_sheet(render.scene, 500);
  EXPECT_LT(seconds_to_the_end(render, 100), most_seconds);
  render.expect_works();
}

// While a tree is built, the callback is asked again and again, from the caller's own thread: Python's Ctrl-C is heard there.
TEST_P(Cancel, TheCallbackIsAskedInTheCallersThreadAlsoWhileATreeIsBuilt) {
  SmallRender render(GetParam());
  SKIP_IF(render.device ? "" : kuafu_last_error());
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
  ASSERT_EQ(kuafu_renderer_render(render.renderer, render.scene, &render.desc), KS_OK) << kuafu_last_error();
  EXPECT_GE(heard.count, 2);
  EXPECT_EQ(heard.elsewhere, 0);
  EXPECT_FALSE(heard.falls);
  EXPECT_EQ(heard.last, 1.0f);
}

INSTANTIATE_TEST_SUITE_P(Tracers, Cancel, testing::Values(KUAFU_TRACER_EMBREE, KUAFU_TRACER_COMPUTE));

}  // namespace
}  // namespace ks::test
