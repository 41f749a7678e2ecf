// SPDX-License-Identifier: Apache-2.0
// Laws of the device and buffer handles of both C APIs.
#include <gtest/gtest.h>

#include <cstring>
#include <thread>
#include <vector>

#include "capi/library_pair.h"

namespace ks::test {
namespace {

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
using Libraries = testing::Types<Kuafu, Simsense>;
struct LibraryName {
  template <class Library>
  static std::string GetName(int) {
    return Library::name;
  }
};
TYPED_TEST_SUITE(Handles, Libraries, LibraryName);

bool says(const char* text, const char* part) { return std::strstr(text, part) != nullptr; }

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

TYPED_TEST(Handles, NullAndForeignHandlesAreNamed) {
  ks_device_info info = ks_device_info_init();
  EXPECT_EQ(TypeParam::device_get_info(nullptr, &info), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_TRUE(says(TypeParam::last_error(), "device is NULL"));
  auto buffer = this->new_buffer(64, 0);
  EXPECT_EQ(TypeParam::device_get_info(reinterpret_cast<typename TypeParam::Device>(buffer), &info), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_TRUE(says(TypeParam::last_error(), "no such handle"));
  void* mapped = nullptr;
  EXPECT_EQ(TypeParam::buffer_map(reinterpret_cast<typename TypeParam::Buffer>(this->device_), &mapped), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(mapped, nullptr);
  TypeParam::buffer_release(buffer);
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
