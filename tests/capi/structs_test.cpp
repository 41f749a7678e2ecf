// SPDX-License-Identifier: Apache-2.0
// Rules of the public structs in both libraries: exported initialisers, older and newer callers, reserved fields.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>

#include "capi/small_render.h"

namespace ks::test {
namespace {

bool says(const char* text, const char* part) { return std::strstr(text, part) != nullptr; }

/// A struct as a library gives it to a caller that reads no headers.
template <class T>
void expect_same(ks_status (*init)(uint32_t, void*, uint32_t), uint32_t type, const T& inline_one) {
  T exported;
  std::memset(&exported, 0xaa, sizeof exported);
  ASSERT_EQ(init(type, &exported, sizeof exported), KS_OK);
  EXPECT_EQ(std::memcmp(&exported, &inline_one, sizeof exported), 0) << "struct type 0x" << std::hex << type;
}

TEST(Structs, ExportedInitialisersAreTheInlineOnes) {
  for (const auto init : {kuafu_struct_init, simsense_struct_init}) {
    expect_same(init, KS_TYPE_DEVICE_DESC, ks_device_desc_init());
    expect_same(init, KS_TYPE_DEVICE_INFO, ks_device_info_init());
    expect_same(init, KS_TYPE_BUFFER_CREATE_DESC, ks_buffer_create_desc_init(0, 0));
    expect_same(init, KS_TYPE_BUFFER_DESC, ks_buffer_desc_init());
    expect_same(init, KS_TYPE_IMAGE_DESC, ks_image_desc_init());
    expect_same(init, KS_TYPE_SYNC, ks_sync_init());
    expect_same(init, KS_TYPE_VULKAN_DEVICE, ks_vulkan_device_init());
    expect_same(init, KS_TYPE_HOST_SERVICES, ks_host_services_init());
  }
  expect_same(kuafu_struct_init, KUAFU_TYPE_MATERIAL_DESC, kuafu_material_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_LIGHT_DESC, kuafu_light_desc_init(KUAFU_LIGHT_POINT));
  expect_same(kuafu_struct_init, KUAFU_TYPE_INSTANCE_DESC, kuafu_instance_desc_init(0));
  expect_same(kuafu_struct_init, KUAFU_TYPE_CAMERA_DESC, kuafu_camera_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_VIEW_DESC, kuafu_view_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_OPTICS_DESC, kuafu_optics_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_MEDIUM_DESC, kuafu_medium_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_RENDERER_DESC, kuafu_renderer_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_RENDER_DESC, kuafu_render_desc_init());
  expect_same(kuafu_struct_init, KUAFU_TYPE_OUTPUT_DESC, kuafu_output_desc_init(0, nullptr, ks_image_desc_init()));
  expect_same(simsense_struct_init, SIMSENSE_TYPE_PARAMETERS, simsense_parameters_init());
  expect_same(simsense_struct_init, SIMSENSE_TYPE_SIGNAL, simsense_signal_init());
  expect_same(simsense_struct_init, SIMSENSE_TYPE_RIG_DESC, simsense_rig_desc_init());
  expect_same(simsense_struct_init, SIMSENSE_TYPE_COMPUTE_DESC, simsense_compute_desc_init());
}

TEST(Structs, AnInitialiserServesShorterAndLongerStructs) {
  ks_sync sync;
  std::memset(&sync, 0xaa, sizeof sync);
  ASSERT_EQ(kuafu_struct_init(KS_TYPE_SYNC, &sync, offsetof(ks_sync, value)), KS_OK);
  EXPECT_EQ(sync.header.size_bytes, offsetof(ks_sync, value));
  EXPECT_EQ(sync.value, 0xaaaaaaaaaaaaaaaaull) << "bytes beyond the caller's struct are not ours to write";
  struct Longer {
    ks_sync known;
    uint64_t later;
  } longer{{}, 7};
  ASSERT_EQ(simsense_struct_init(KS_TYPE_SYNC, &longer, sizeof longer), KS_OK);
  EXPECT_EQ(longer.later, 0u);
  EXPECT_EQ(simsense_struct_init(KUAFU_TYPE_MATERIAL_DESC, &sync, sizeof sync), KS_ERROR_INVALID_ARGUMENT) << "of the other library";
  EXPECT_EQ(kuafu_struct_init(KS_TYPE_SYNC, nullptr, sizeof sync), KS_ERROR_INVALID_ARGUMENT);
}

struct Scene {
  kuafu_device device = open_test_device<Kuafu>();
  kuafu_scene scene = nullptr;
  Scene() { EXPECT_EQ(kuafu_scene_create(device, &scene), KS_OK) << kuafu_last_error(); }
  ~Scene() {
    kuafu_scene_release(scene);
    kuafu_device_release(device);
  }
};

TEST(Structs, AMissingFieldIsZero) {
  const Scene s;
  kuafu_material_desc old = kuafu_material_desc_init();
  old.header.size_bytes = offsetof(kuafu_material_desc, iridescence_least_thickness_nm);
  ASSERT_EQ(old.header.size_bytes % sizeof(void*), 0u) << "pick a field that begins there";
  old.iridescence_least_thickness_nm = 99;  // not of the caller's struct
  uint32_t id = 0;
  ASSERT_EQ(kuafu_scene_add_material(s.scene, &old, &id), KS_OK) << kuafu_last_error();
  kuafu_material_desc read = kuafu_material_desc_init();
  ASSERT_EQ(kuafu_scene_get_material(s.scene, id, &read), KS_OK);
  EXPECT_EQ(read.iridescence_least_thickness_nm, 0.0f);
}

TEST(Structs, NoStructEndsInsideOfAPointer) {
  const Scene s;
  uint32_t id = 0;
  for (uint32_t size = 0; size < sizeof(kuafu_texture_desc); ++size) {
    kuafu_texture_desc texture = kuafu_texture_desc_init();
    const uint8_t texel = 0;
    texture.texels = &texel;
    texture.header.size_bytes = size;
    EXPECT_EQ(kuafu_scene_add_texture(s.scene, &texture, &id), KS_ERROR_INVALID_ARGUMENT) << size;
    if (size % 8 != 0 || size == 0) {
      EXPECT_TRUE(says(kuafu_last_error(), "bytes long: fill it")) << kuafu_last_error();
    }
  }
}

TEST(Structs, AnOutputThatEndsInsideOfAFieldIsRefusedAndReadsNothingBeyond) {
  SmallRender render(KUAFU_TRACER_AUTO);
  SKIP_IF(render.device ? "" : kuafu_last_error());
  for (uint32_t size = 0; size < sizeof render.output; ++size) {
    render.output.header.size_bytes = size;
    const ks_status status = kuafu_renderer_render(render.renderer, render.scene, &render.desc);
    if (size % 8 != 0 || size < offsetof(kuafu_output_desc, image)) {
      EXPECT_EQ(status, KS_ERROR_INVALID_ARGUMENT) << size;
    }
  }
}

/// A struct of a later header: today's, and a field that nobody knows here.
template <class T>
struct FromTheFuture {
  T known;
  uint64_t later = 0;
};

template <class T>
FromTheFuture<T> from_the_future(const T& known) {
  FromTheFuture<T> longer{known};
  longer.known.header.size_bytes = sizeof longer;
  return longer;
}

template <class Library>
class Future : public testing::Test {};
using Libraries = testing::Types<Kuafu, Simsense>;
TYPED_TEST_SUITE(Future, Libraries);

TYPED_TEST(Future, ALongerStructIsTakenWhileWhatIsNewInItIsZeroAndElseRefused) {
  const auto opened = open_test_device<TypeParam>();
  SKIP_IF(opened ? "" : TypeParam::last_error());
  auto desc = from_the_future(ks_device_desc_init());
  desc.known.select = KS_SELECT_CPU;
  typename TypeParam::Device device = nullptr;
  EXPECT_EQ(TypeParam::device_create(&desc.known, &device), KS_OK) << TypeParam::last_error();
  TypeParam::device_release(device);
  desc.later = 1;
  EXPECT_EQ(TypeParam::device_create(&desc.known, &device), KS_ERROR_VERSION);
  EXPECT_EQ(device, nullptr);
  EXPECT_TRUE(says(TypeParam::last_error(), "does not know")) << TypeParam::last_error();

  auto create = from_the_future(ks_buffer_create_desc_init(64, KS_BUFFER_HOST_VISIBLE));
  typename TypeParam::Buffer buffer = nullptr;
  EXPECT_EQ(TypeParam::buffer_create(opened, &create.known, &buffer), KS_OK) << TypeParam::last_error();
  TypeParam::buffer_release(buffer);
  create.later = uint64_t{1} << 63;
  EXPECT_EQ(TypeParam::buffer_create(opened, &create.known, &buffer), KS_ERROR_VERSION);
  TypeParam::device_release(opened);
}

TEST(Structs, ALongerStructOfEachLibrarysOwnIsRefusedToo) {
  const Scene s;
  uint32_t id = 0;
  auto material = from_the_future(kuafu_material_desc_init());
  EXPECT_EQ(kuafu_scene_add_material(s.scene, &material.known, &id), KS_OK) << kuafu_last_error();
  material.later = 1;
  EXPECT_EQ(kuafu_scene_add_material(s.scene, &material.known, &id), KS_ERROR_VERSION);

  const simsense_device device = open_test_device<Simsense>();
  auto rig = from_the_future(simsense_rig_desc_init());
  rig.later = 1;
  simsense_engine engine = nullptr;
  EXPECT_EQ(simsense_engine_create(device, &rig.known, nullptr, &engine), KS_ERROR_VERSION);
  EXPECT_EQ(engine, nullptr);
  simsense_device_release(device);
}

TEST(Structs, ReservedFieldsMustBeZero) {
  const Scene s;
  uint32_t id = 0;
  kuafu_texture_desc texture = kuafu_texture_desc_init();
  const uint8_t texel = 7;
  texture.texels = &texel;
  texture.width = texture.height = 1;
  texture.format = KS_FORMAT_U8;
  texture.reserved = 1;
  EXPECT_EQ(kuafu_scene_add_texture(s.scene, &texture, &id), KS_ERROR_VERSION);
  EXPECT_TRUE(says(kuafu_last_error(), "byte 84")) << kuafu_last_error();
}

}  // namespace
}  // namespace ks::test
