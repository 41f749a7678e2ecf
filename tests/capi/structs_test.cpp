// SPDX-License-Identifier: Apache-2.0
// Structs of other versions, handles of all kinds and ages, every function with wrong ones.
#include <gtest/gtest.h>

#include <cstring>
#include <thread>
#include <vector>

#include "capi/library_pair.h"
#include "capi/small_render.h"

namespace ks::test {
namespace {

using Libraries = testing::Types<Kuafu, Simsense>;

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
    const ks_status status = render.render();
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

template <class Library>
class Handles : public testing::Test {
 protected:
  using Device = typename Library::Device;
  using Buffer = typename Library::Buffer;
  void SetUp() override { SKIP_IF(device_ ? "" : Library::last_error()); }
  void TearDown() override { Library::device_release(device_); }
  Buffer new_buffer(uint64_t size, uint32_t flags) {
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(size, flags);
    Buffer buffer = nullptr;
    EXPECT_EQ(Library::buffer_create(device_, &create, &buffer), KS_OK) << Library::last_error();
    return buffer;
  }
  Device device_ = open_test_device<Library>();
};
struct LibraryName {
  template <class Library>
  static std::string GetName(int) {
    return Library::name;
  }
};
TYPED_TEST_SUITE(Handles, Libraries, LibraryName);

TYPED_TEST(Handles, AllocatedBytesAreThoseOfTheBuffersThatLive) {
  uint64_t before = 0, with = 0, after = 0;
  ASSERT_EQ(TypeParam::device_allocated_bytes(this->device_, &before), KS_OK);
  const auto buffer = this->new_buffer(1 << 20, KS_BUFFER_HOST_VISIBLE);
  ASSERT_EQ(TypeParam::device_allocated_bytes(this->device_, &with), KS_OK);
  TypeParam::buffer_release(buffer);
  ASSERT_EQ(TypeParam::device_allocated_bytes(this->device_, &after), KS_OK);
  EXPECT_GE(with, before + (1 << 20));
  EXPECT_LT(with, before + (1 << 20) + (1 << 16));
  EXPECT_EQ(after, before);
}

TYPED_TEST(Handles, EnumerationTellsTheCountAndFillsWhatFits) {
  uint32_t count = 0;
  EXPECT_EQ(TypeParam::device_enumerate(nullptr, nullptr), KS_ERROR_INVALID_ARGUMENT);
  ASSERT_EQ(TypeParam::device_enumerate(nullptr, &count), KS_OK);
  ASSERT_GE(count, 1u) << TypeParam::last_error();
  std::vector<ks_device_info> infos(count + 1, ks_device_info_init());
  uint32_t capacity = 1;
  ASSERT_EQ(TypeParam::device_enumerate(infos.data(), &capacity), KS_OK);
  EXPECT_EQ(capacity, count);
  EXPECT_NE(infos[0].name[0], '\0');
  EXPECT_EQ(infos[1].name[0], '\0') << "no more than the capacity is written";
  capacity = count + 1;
  ASSERT_EQ(TypeParam::device_enumerate(infos.data(), &capacity), KS_OK);
  bool lavapipe = false;
  for (uint32_t i = 0; i < count; ++i) {
    EXPECT_EQ(infos[i].index, i);
    EXPECT_EQ(infos[i].usable != 0, infos[i].refused[0] == '\0') << infos[i].name;
    lavapipe = lavapipe || (infos[i].kind == KS_DEVICE_KIND_CPU && infos[i].usable);
  }
  EXPECT_TRUE(lavapipe);
}

TYPED_TEST(Handles, ADeviceFoundByUuidIsThatDevice) {
  ks_device_info info = ks_device_info_init();
  ASSERT_EQ(TypeParam::device_get_info(this->device_, &info), KS_OK);
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_UUID;
  std::memcpy(desc.uuid, info.device_uuid, sizeof desc.uuid);
  typename TypeParam::Device again = nullptr;
  ASSERT_EQ(TypeParam::device_create(&desc, &again), KS_OK) << TypeParam::last_error();
  ks_device_info same = ks_device_info_init();
  ASSERT_EQ(TypeParam::device_get_info(again, &same), KS_OK);
  EXPECT_STREQ(same.name, info.name);
  TypeParam::device_release(again);
  desc.uuid[0] ^= 0xff;
  EXPECT_EQ(TypeParam::device_create(&desc, &again), KS_ERROR_NO_DEVICE);
  EXPECT_EQ(again, nullptr);
  EXPECT_TRUE(says(TypeParam::last_error(), info.name)) << TypeParam::last_error();
}

TYPED_TEST(Handles, AnyReleaseOrderIsLegal) {
  ks_device_desc desc = ks_device_desc_init();
  typename TypeParam::Device device = nullptr;
  ASSERT_EQ(TypeParam::device_create(&desc, &device), KS_OK);
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(64, KS_BUFFER_HOST_VISIBLE);
  typename TypeParam::Buffer buffer = nullptr;
  ASSERT_EQ(TypeParam::buffer_create(device, &create, &buffer), KS_OK);
  TypeParam::device_release(device);
  const uint32_t mark = 0x1234;
  uint32_t value = 0;
  EXPECT_EQ(TypeParam::buffer_write(buffer, 60, &mark, 4), KS_OK);
  EXPECT_EQ(TypeParam::buffer_read(buffer, 60, &value, 4), KS_OK);
  EXPECT_EQ(value, mark);
  TypeParam::buffer_release(buffer);
  TypeParam::buffer_release(nullptr);
  TypeParam::device_release(nullptr);
}

TYPED_TEST(Handles, RetainKeepsAHandleUntilItsLastRelease) {
  auto buffer = this->new_buffer(64, KS_BUFFER_HOST_VISIBLE);
  TypeParam::buffer_retain(buffer);
  TypeParam::buffer_release(buffer);
  void* mapped = nullptr;
  EXPECT_EQ(TypeParam::buffer_map(buffer, &mapped), KS_OK);
  EXPECT_NE(mapped, nullptr);
  TypeParam::buffer_release(buffer);
  TypeParam::device_retain(this->device_);
  TypeParam::device_release(this->device_);
}

TYPED_TEST(Handles, AReleasedHandleIsRefusedAlsoAfterOthersWereMade) {
  const auto released = this->new_buffer(64, KS_BUFFER_HOST_VISIBLE);
  TypeParam::buffer_release(released);
  for (int i = 0; i < 1000; ++i) {
    const auto other = this->new_buffer(64, KS_BUFFER_HOST_VISIBLE);
    void* mapped = nullptr;
    ASSERT_EQ(TypeParam::buffer_map(released, &mapped), KS_ERROR_INVALID_ARGUMENT) << i;
    ASSERT_TRUE(says(TypeParam::last_error(), "was released")) << TypeParam::last_error();
    TypeParam::buffer_release(released);
    ASSERT_EQ(TypeParam::buffer_map(other, &mapped), KS_OK) << "a second release takes nobody else's reference";
    TypeParam::buffer_release(other);
  }
}

TYPED_TEST(Handles, StructsOfOlderCallersAreUnderstoodAndGarbageIsNot) {
  ks_device_info old_info = ks_device_info_init();
  old_info.header.size_bytes = offsetof(ks_device_info, memory_bytes);
  old_info.memory_bytes = 42;
  ASSERT_EQ(TypeParam::device_get_info(this->device_, &old_info), KS_OK) << TypeParam::last_error();
  EXPECT_EQ(old_info.memory_bytes, 42u) << "bytes beyond the caller's struct are not ours to write";
  EXPECT_EQ(old_info.usable, 1u);

  typename TypeParam::Buffer buffer = nullptr;
  ks_buffer_create_desc garbage = ks_buffer_create_desc_init(64, 0);
  garbage.header.type = KS_TYPE_SYNC;
  EXPECT_EQ(TypeParam::buffer_create(this->device_, &garbage, &buffer), KS_ERROR_INVALID_ARGUMENT);
  for (const uint32_t size : {0u, 4u, 0xffffffffu}) {
    garbage = ks_buffer_create_desc_init(64, 0);
    garbage.header.size_bytes = size;
    EXPECT_EQ(TypeParam::buffer_create(this->device_, &garbage, &buffer), KS_ERROR_INVALID_ARGUMENT) << size;
  }
}

TYPED_TEST(Handles, LastErrorBelongsToItsThread) {
  EXPECT_EQ(TypeParam::device_create(nullptr, nullptr), KS_ERROR_INVALID_ARGUMENT);
  const std::string mine = TypeParam::last_error();
  std::string others = "unset";
  std::thread([&others] { others = TypeParam::last_error(); }).join();
  EXPECT_NE(mine, "");
  EXPECT_EQ(others, "");
}

TEST(HostDevice, SimsenseRunsOnItAndKuafuRefusesIt) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_HOST;
  simsense_device host = nullptr;
  ASSERT_EQ(simsense_device_create(&desc, &host), KS_OK) << simsense_last_error();
  simsense_device_release(host);
  kuafu_device none = nullptr;
  EXPECT_EQ(kuafu_device_create(&desc, &none), KS_ERROR_UNSUPPORTED);
  EXPECT_TRUE(says(kuafu_last_error(), "KS_SELECT_CPU")) << kuafu_last_error();
}

}  // namespace
}  // namespace ks::test
