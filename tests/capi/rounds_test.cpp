// SPDX-License-Identifier: Apache-2.0
// Each public object made and released again and again: the heap and the open files stay as they are. ACTIVESTEREO_FULL=1 takes 100 000
// rounds and prints the curve; of objects that take milliseconds each, 10 000. Else it takes a hundredth, in which 160 bytes that each
// round leaves behind are found, or 1.6 KiB of objects that take milliseconds.
#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>

#include "capi/small_match.h"
#include "capi/small_render.h"
#include "support/heap.h"

namespace ks::test {
namespace {

size_t round_count(size_t most = 100000) { return std::getenv("ACTIVESTEREO_FULL") != nullptr ? most : most / 100; }

/// Runs `round` so often after a tenth for warming up. The heap may end larger by `bytes_each` per round and what its caches hold.
void expect_flat(const char* what, size_t rounds, const std::function<void()>& round) {
  constexpr double caches_hold = 160 << 10;  // of which 80 KiB are the handles that are remembered (device/handle.h)
  for (size_t i = 0; i < rounds / 10; ++i) round();
  const size_t files = open_files();
  const auto begin = static_cast<double>(heap_bytes());
  for (size_t tenth = 1; tenth <= 10; ++tenth) {
    for (size_t i = 0; i < rounds / 10; ++i) round();
    if (rounds > 1000)
      std::printf("%s: %zu rounds, heap %+.1f KiB\n", what, tenth * rounds / 10, (static_cast<double>(heap_bytes()) - begin) / 1024);
  }
  EXPECT_LT(static_cast<double>(heap_bytes()) - begin, caches_hold) << what;
  EXPECT_EQ(open_files(), files) << what;
}

template <class Library>
class Rounds : public testing::Test {
 protected:
  void SetUp() override { SKIP_IF(device_ ? "" : Library::last_error()); }
  void TearDown() override { Library::device_release(device_); }
  typename Library::Device device_ = open_test_device<Library>();
};
using Libraries = testing::Types<Kuafu, Simsense>;
TYPED_TEST_SUITE(Rounds, Libraries);

TYPED_TEST(Rounds, Buffers) {
  expect_flat("buffer", round_count(), [&] {
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(4096, KS_BUFFER_HOST_VISIBLE | KS_BUFFER_EXPORTABLE);
    typename TypeParam::Buffer buffer = nullptr, refused = nullptr;
    ASSERT_EQ(TypeParam::buffer_create(this->device_, &create, &buffer), KS_OK) << TypeParam::last_error();
    ks_buffer_desc desc = ks_buffer_desc_init();
    EXPECT_EQ(TypeParam::buffer_export(buffer, KS_MEMORY_HOST, &desc), KS_OK);
    desc.size_bytes = 8192;
    EXPECT_LT(TypeParam::buffer_import(this->device_, &desc, &refused), 0);
    TypeParam::buffer_release(buffer);
  });
}

TYPED_TEST(Rounds, Devices) {
  expect_flat("device", round_count(10000), [] {  // each starts threads and opens the driver
    const typename TypeParam::Device device = open_test_device<TypeParam>();
    ASSERT_NE(device, nullptr) << TypeParam::last_error();
    TypeParam::device_release(device);
  });
}

TEST(RoundsOfSimsense, DevicesWithoutVulkan) {
  expect_flat("device without Vulkan", round_count(), [] { simsense_device_release(open_host_device()); });
}

TEST(RoundsOfKuafu, ScenesAndWhatIsInThem) {
  const kuafu_device device = open_test_device<Kuafu>();
  SKIP_IF(device ? "" : kuafu_last_error());
  static constexpr float positions[] = {-9, -9, 2, 9, -9, 2, -9, 9, 2};
  static constexpr uint32_t indices[] = {0, 1, 2};
  static constexpr unsigned char texels[64] = {};
  kuafu_mesh_desc mesh = kuafu_mesh_desc_init();
  mesh.positions = positions, mesh.vertex_count = 3, mesh.indices = indices, mesh.triangle_count = 1;
  kuafu_texture_desc texture = kuafu_texture_desc_init();
  texture.texels = texels, texture.width = texture.height = 8, texture.format = KS_FORMAT_U8;
  expect_flat("scene", round_count(), [&] {
    kuafu_scene scene = nullptr;
    uint32_t id = 0;
    ASSERT_EQ(kuafu_scene_create(device, &scene), KS_OK);
    EXPECT_EQ(kuafu_scene_add_mesh(scene, &mesh, &id), KS_OK);
    const kuafu_instance_desc instance = kuafu_instance_desc_init(id);
    EXPECT_EQ(kuafu_scene_add_instance(scene, &instance, &id), KS_OK);
    EXPECT_EQ(kuafu_scene_add_texture(scene, &texture, &id), KS_OK);
    kuafu_material_desc material = kuafu_material_desc_init();
    material.base_color_texture = id;
    EXPECT_EQ(kuafu_scene_add_material(scene, &material, &id), KS_OK);
    const kuafu_light_desc light = kuafu_light_desc_init(KUAFU_LIGHT_POINT);
    EXPECT_EQ(kuafu_scene_add_light(scene, &light, &id), KS_OK);
    kuafu_scene_release(scene);
  });
  kuafu_device_release(device);
}

TEST(RoundsOfKuafu, RenderersThatRender) {
  SmallRender render(KUAFU_TRACER_EMBREE);
  SKIP_IF(render.device ? "" : kuafu_last_error());
  kuafu_renderer_desc desc = kuafu_renderer_desc_init();
  desc.tracer = KUAFU_TRACER_EMBREE;
  const auto round = [&] {
    kuafu_renderer renderer = nullptr;
    ks_sync sync = ks_sync_init();
    ASSERT_EQ(kuafu_renderer_create(render.device, &desc, &renderer), KS_OK);
    ASSERT_EQ(kuafu_renderer_submit(renderer, render.scene, &render.desc, &sync), KS_OK) << kuafu_last_error();
    EXPECT_EQ(kuafu_renderer_wait(renderer, &sync, UINT64_MAX), KS_OK) << kuafu_last_error();
    kuafu_renderer_release(renderer);
  };
  expect_flat("renderer", round_count(10000), round);
}

TEST(RoundsOfSimsense, EnginesThatCompute) {
  SmallMatch match(open_host_device());
  expect_flat("engine", round_count(), [&] {
    simsense_engine engine = nullptr;
    ASSERT_EQ(simsense_engine_create(match.device, &match.rig, &match.parameters, &engine), KS_OK) << simsense_last_error();
    EXPECT_EQ(simsense_engine_compute(engine, &match.desc), KS_OK) << simsense_last_error();
    simsense_engine_release(engine);
  });
}

}  // namespace
}  // namespace ks::test
