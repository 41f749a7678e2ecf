// SPDX-License-Identifier: Apache-2.0
// Rendering through the C API: what is refused and why, strides, progress and cancelling, stage times, several scenes and renderers.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "kuafu/world.h"

namespace {

using namespace laws;

class RenderApi : public testing::Test {
 protected:
  void SetUp() override {
    world_.add(quad({0, 0, 1}, {-1, 0, 0}, {0, 1, 0}), lambert(0.5f));
    world_.set_environment(1.0f);
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes, KS_BUFFER_HOST_VISIBLE);
    ASSERT_EQ(kuafu_buffer_create(shared_device(), &create, &buffer_), KS_OK) << kuafu_last_error();
    view_ = view_at({0, 0, 0}, 8, 4, 20);
    const uint64_t shape[4] = {1, 4, 8, 1};
    output_ = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer_, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
    desc_ = kuafu_render_desc_init();
    desc_.views = &view_;
    desc_.view_count = 1;
    desc_.outputs = &output_;
    desc_.output_count = 1;
    desc_.samples_per_pixel = 1;
  }
  void TearDown() override { kuafu_buffer_release(buffer_); }

  ks_status render() { return kuafu_renderer_render(world_.renderer(), world_.scene(), &desc_); }
  /// Refused as `status`, with `part` in the message; what `change` touched is put back.
  void refused(const std::string& part, const std::function<void()>& change, ks_status status = KS_ERROR_INVALID_ARGUMENT) {
    const auto saved = std::tuple(view_, output_, desc_);
    change();
    EXPECT_EQ(render(), status) << part;
    EXPECT_NE(std::string(kuafu_last_error()).find(part), std::string::npos) << kuafu_last_error();
    std::tie(view_, output_, desc_) = saved;
    EXPECT_EQ(render(), KS_OK) << kuafu_last_error();
  }

  static constexpr uint64_t bytes = 4096;
  World world_;
  kuafu_buffer buffer_ = nullptr;
  kuafu_view_desc view_{};
  kuafu_output_desc output_{};
  kuafu_render_desc desc_{};
};

TEST_F(RenderApi, refuses_wrong_numbers_by_name) {
  refused("view_count", [&] { desc_.view_count = 0; });
  refused("views is NULL", [&] { desc_.views = nullptr; });
  refused("output_count", [&] { desc_.output_count = 0; });
  refused("samples_per_pixel", [&] { desc_.samples_per_pixel = 0; });
  refused("first_sample", [&] { desc_.first_sample = std::numeric_limits<uint32_t>::max(); });
  refused("max_bounces", [&] { desc_.max_bounces = 1u << 20; });
  refused("ir_ambient_scale", [&] { desc_.ir_ambient_scale = NAN; });
  refused("ir_ambient_radiance", [&] { desc_.ir_ambient_radiance = -1; });
  refused("struct type", [&] { desc_.header.type = KUAFU_TYPE_VIEW_DESC; });
}

TEST_F(RenderApi, refuses_wrong_views) {
  refused("0 x 4", [&] { view_.camera.width = 0; });
  refused("focal", [&] { view_.camera.k[0] = 0; });
  refused("finite", [&] { view_.camera.camera_to_world[3] = NAN; });
  refused("near", [&] { view_.camera.near_m = -1; });
  refused("band", [&] { view_.band = 7; });
  refused("environment", [&] { view_.environment = 1u << 30; });
}

TEST_F(RenderApi, refuses_views_that_differ) {
  kuafu_view_desc two[2] = {view_, view_};
  desc_.views = two;
  desc_.view_count = 2;
  two[1].camera.width = 9;
  expect_refused(render(), "views[1] is 9 x 4");
  two[1] = view_;
  two[1].band = KUAFU_BAND_VISIBLE;
  EXPECT_EQ(render(), KS_ERROR_INVALID_ARGUMENT);
}

TEST_F(RenderApi, refuses_wrong_outputs) {
  refused("no KUAFU_OUTPUT", [&] { output_.output = 99; });
  refused("KUAFU_OUTPUT_RADIANCE is NULL", [&] { output_.buffer = nullptr; });
  refused("KS_FORMAT_F32", [&] { output_.image.format = KS_FORMAT_U32; });
  refused("KS_FORMAT_U32", [&] { output_.output = KUAFU_OUTPUT_INSTANCE_ID; });
  refused("[1][4][8][3]", [&] { view_.band = KUAFU_BAND_VISIBLE; });
  refused("[1][4][8][1]", [&] { output_.image.shape[1] = 5; });
  refused("leaves its", [&] { output_.image.offset_bytes = bytes; });
  refused("leaves its", [&] { output_.image.byte_stride[1] = int64_t(1) << 61; });
  refused("multiples", [&] { output_.image.byte_stride[1] = 33; });
  refused("packed", [&] { output_.image.byte_stride[2] = 8; });
}

TEST_F(RenderApi, refuses_an_output_twice) {
  kuafu_output_desc two[2] = {output_, output_};
  desc_.outputs = two;
  desc_.output_count = 2;
  expect_refused(render(), "twice");
}

TEST_F(RenderApi, refuses_an_unknown_tracer) {
  kuafu_renderer renderer = reinterpret_cast<kuafu_renderer>(this);
  const kuafu_renderer_desc desc{ks_header_make(KUAFU_TYPE_RENDERER_DESC, sizeof desc), 9, 0};
  EXPECT_EQ(kuafu_renderer_create(shared_device(), &desc, &renderer), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(renderer, nullptr);
}

TEST_F(RenderApi, writes_only_where_the_strides_say) {
  std::vector<float> marks(bytes / 4, -7.0f);
  ok(kuafu_buffer_write(buffer_, 0, marks.data(), bytes));
  // Bottom row first, rows of 16 floats, from the 10th float on.
  output_.image.byte_stride[1] = -64;
  output_.image.offset_bytes = 40 + 3 * 64;
  ASSERT_EQ(render(), KS_OK) << kuafu_last_error();
  ok(kuafu_buffer_read(buffer_, 0, marks.data(), bytes));
  for (size_t i = 0; i < marks.size(); ++i) {
    const bool inside = i >= 10 && i < 10 + 4 * 16 && (i - 10) % 16 < 8;
    if (inside)
      EXPECT_NEAR(marks[i], 0.5f, 1e-4) << i;
    else
      EXPECT_EQ(marks[i], -7.0f) << i;
  }
}

TEST_F(RenderApi, progress_never_falls_ends_at_one_and_cancels) {
  struct Watch {
    std::vector<float> fractions;
    float stop_at = 2;
  } watch;
  desc_.samples_per_pixel = 1024;  // several passes
  desc_.progress_user = &watch;
  desc_.progress = [](void* user, float fraction) -> int32_t {
    auto* w = static_cast<Watch*>(user);
    w->fractions.push_back(fraction);
    return fraction >= w->stop_at;
  };
  ASSERT_EQ(render(), KS_OK) << kuafu_last_error();
  ASSERT_GT(watch.fractions.size(), 1u);
  EXPECT_TRUE(std::is_sorted(watch.fractions.begin(), watch.fractions.end()));
  EXPECT_EQ(watch.fractions.back(), 1.0f);
  watch.fractions.clear();
  watch.stop_at = 0.4f;
  EXPECT_EQ(render(), KS_ERROR_CANCELLED);
  EXPECT_LT(watch.fractions.back(), 1.0f);
  watch.stop_at = 2;
  EXPECT_EQ(render(), KS_OK) << kuafu_last_error();
}

TEST_F(RenderApi, stage_times_name_the_stages) {
  ASSERT_EQ(render(), KS_OK);
  uint32_t count = 0;
  ok(kuafu_renderer_get_stage_times(world_.renderer(), nullptr, &count));
  std::vector<ks_stage_time> times(count);
  ok(kuafu_renderer_get_stage_times(world_.renderer(), times.data(), &count));
  for (const char* name : {"upload", "acceleration build", "generate", "trace closest", "shade", "accumulate"})
    EXPECT_TRUE(std::ranges::any_of(times, [&](const ks_stage_time& t) { return std::string(t.name) == name && t.milliseconds >= 0; }))
        << name;
}

TEST_F(RenderApi, rendering_again_copies_nothing) {
  ASSERT_EQ(render(), KS_OK);
  uint64_t before = 0, after = 0;
  ok(kuafu_device_copied_bytes(shared_device(), &before));
  view_.camera.camera_to_world[3] = 0.1;
  ASSERT_EQ(render(), KS_OK);
  ok(kuafu_device_copied_bytes(shared_device(), &after));
  EXPECT_EQ(before, after);
}

TEST_F(RenderApi, one_renderer_serves_several_scenes) {
  kuafu_scene empty = nullptr;
  ok(kuafu_scene_create(shared_device(), &empty));
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(kuafu_renderer_render(world_.renderer(), empty, &desc_), KS_OK) << kuafu_last_error();
    float value = -1;
    ok(kuafu_buffer_read(buffer_, 0, &value, 4));
    EXPECT_NEAR(value, desc_.ir_ambient_radiance, 1e-6);  // an empty scene shows its environment, black but for the constant
    EXPECT_NEAR(world_.radiance(view_).mean(), 0.5, 1e-4);
  }
  kuafu_scene_release(empty);
  EXPECT_NEAR(world_.radiance(view_).mean(), 0.5, 1e-4);
}

TEST_F(RenderApi, handles_may_be_released_in_any_order) {
  kuafu_device device = nullptr;
  kuafu_scene scene = nullptr;
  kuafu_renderer renderer = nullptr;
  ASSERT_EQ(kuafu_device_create(nullptr, &device), KS_OK) << kuafu_last_error();
  ok(kuafu_scene_create(device, &scene));
  ok(kuafu_renderer_create(device, nullptr, &renderer));
  kuafu_buffer own = nullptr;
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(bytes, KS_BUFFER_HOST_VISIBLE);
  ok(kuafu_buffer_create(device, &create, &own));
  kuafu_device_release(device);
  output_.buffer = own;
  ASSERT_EQ(kuafu_renderer_render(renderer, scene, &desc_), KS_OK) << kuafu_last_error();
  kuafu_scene_release(scene);
  kuafu_buffer_release(own);
  kuafu_renderer_release(renderer);
}

}  // namespace
