// SPDX-License-Identifier: Apache-2.0
// A small render over the C API, for tests of what may happen around it.
#pragma once

#include <gtest/gtest.h>

#include <vector>

#include "capi/library_pair.h"

namespace ks::test {

/// A device, and a small render of a triangle at 2 m that covers the image's upper left half.
struct SmallRender {
  static constexpr uint32_t side = 64;
  kuafu_device device;
  kuafu_scene scene = nullptr;
  kuafu_renderer renderer = nullptr;
  kuafu_buffer buffer = nullptr;
  kuafu_view_desc view = kuafu_view_desc_init();
  kuafu_output_desc output{};
  kuafu_render_desc desc = kuafu_render_desc_init();
  ks_status status = KS_OK;  // of the first call that failed

  /// Takes the device over. may_fail: `status` is looked at.
  explicit SmallRender(uint32_t tracer, kuafu_device on = open_test_device<Kuafu>(), bool may_fail = false) : device(on) {
    if (device == nullptr) return;
    const float positions[] = {-9, -9, 2, 9, -9, 2, -9, 9, 2};
    const uint32_t indices[] = {0, 1, 2};
    kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
    mesh.positions = positions, mesh.vertex_count = 3, mesh.indices = indices, mesh.triangle_count = 1;
    kuafu_instance_desc instance = kuafu_instance_desc_init(1);
    kuafu_environment_desc environment = kuafu_environment_desc_init();
    for (float& r : environment.radiance) r = 1.0f;
    kuafu_renderer_desc renderer_desc = kuafu_renderer_desc_init();
    renderer_desc.tracer = tracer;
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(side * side * 4, KS_BUFFER_HOST_VISIBLE);
    uint32_t id = 0;
    const auto step = [&](ks_status answer) {
      EXPECT_TRUE(may_fail || answer == KS_OK) << kuafu_last_error();
      if (status == KS_OK) status = answer;
    };
    step(kuafu_scene_create(device, &scene));
    step(kuafu_scene_add_mesh(scene, &mesh, &instance.mesh));
    step(kuafu_scene_add_instance(scene, &instance, &id));
    step(kuafu_scene_set_environment(scene, &environment));
    step(kuafu_renderer_create(device, &renderer_desc, &renderer));
    step(kuafu_buffer_create(device, &create, &buffer));
    view.camera.width = view.camera.height = side;
    view.camera.k[0] = view.camera.k[4] = 60, view.camera.k[2] = view.camera.k[5] = 31.5;
    const uint64_t shape[4] = {1, side, side, 1};
    output = kuafu_output_desc_init(KUAFU_OUTPUT_RADIANCE, buffer, ks_image_desc_packed(KS_FORMAT_F32, 4, shape));
    view.band = KUAFU_BAND_INFRARED;
    desc.views = &view, desc.view_count = 1, desc.outputs = &output, desc.output_count = 1;
    desc.samples_per_pixel = 1;
  }
  ~SmallRender() {
    kuafu_buffer_release(buffer);
    kuafu_renderer_release(renderer);
    kuafu_scene_release(scene);
    kuafu_device_release(device);
  }
  SmallRender(const SmallRender&) = delete;
  SmallRender& operator=(const SmallRender&) = delete;

  ks_status render() { return kuafu_renderer_render(renderer, scene, &desc); }
  std::vector<float> image() {
    std::vector<float> pixels(side * side);
    EXPECT_EQ(kuafu_buffer_read(buffer, 0, pixels.data(), pixels.size() * sizeof(float)), KS_OK) << kuafu_last_error();
    return pixels;
  }
  /// A short render works.
  void expect_works() {
    desc.samples_per_pixel = 1, desc.progress = nullptr;
    EXPECT_EQ(render(), KS_OK) << kuafu_last_error();
  }
};

/// A small render of its own for every test.
class EachTracer : public testing::TestWithParam<uint32_t> {
 protected:
  void SetUp() override { SKIP_IF(render.device ? "" : kuafu_last_error()); }
  SmallRender render{GetParam()};
};

}  // namespace ks::test
