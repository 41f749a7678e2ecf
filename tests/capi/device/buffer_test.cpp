// SPDX-License-Identifier: Apache-2.0
#include "device/buffer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "capi/device/devices.h"
#include "capi/device/expect_error.h"

namespace ks {
namespace {

class EveryDevice : public testing::TestWithParam<const char*> {
 protected:
  std::shared_ptr<Device> device_ = std::string(GetParam()) == "host"  ? test::host_device()
                                    : std::string(GetParam()) == "cpu" ? test::cpu_device()
                                                                       : test::best_device();
};
INSTANTIATE_TEST_SUITE_P(Buffer, EveryDevice, testing::Values("host", "cpu", "best"), [](const auto& info) { return info.param; });

TEST_P(EveryDevice, NewBuffersAreZero) {
  for (const uint32_t flags : {0u, KS_BUFFER_HOST_VISIBLE}) {
    for (const uint64_t size : {1u, 17u, 4099u}) {
      const auto buffer = Buffer::create(device_, size, flags);
      std::vector<uint8_t> bytes(size, 0xab);
      buffer->read(0, bytes.data(), size);
      EXPECT_EQ(std::count(bytes.begin(), bytes.end(), 0), static_cast<ptrdiff_t>(size));
      EXPECT_EQ(buffer->size_bytes(), size);
    }
  }
}

TEST_P(EveryDevice, WhatIsWrittenIsRead) {
  for (const uint32_t flags : {0u, KS_BUFFER_HOST_VISIBLE}) {
    const auto buffer = Buffer::create(device_, 1001, flags);
    std::vector<uint8_t> out(500), in(500, 0);
    std::iota(out.begin(), out.end(), 1);
    buffer->write(501, out.data(), 500);
    buffer->read(501, in.data(), 500);
    EXPECT_EQ(in, out);
    uint8_t before = 1;
    buffer->read(500, &before, 1);
    EXPECT_EQ(before, 0);
  }
}

TEST_P(EveryDevice, CopiesAreCountedOnce) {
  const auto buffer = Buffer::create(device_, 4096, 0);
  EXPECT_EQ(device_->copied_bytes(), 0u) << "filling with zero is no copy";
  std::vector<uint8_t> data(300);
  buffer->write(0, data.data(), 300);
  EXPECT_EQ(device_->copied_bytes(), 300u);
  buffer->read(0, data.data(), 100);
  EXPECT_EQ(device_->copied_bytes(), 400u);
}

TEST_P(EveryDevice, AccessOutsideTheBufferIsRefused) {
  const auto buffer = Buffer::create(device_, 100, 0);
  uint8_t data[200] = {};
  EXPECT_ERROR(buffer->write(0, data, 101), KS_ERROR_INVALID_ARGUMENT, "leaves the buffer of 100 bytes");
  EXPECT_ERROR(buffer->read(100, data, 1), KS_ERROR_INVALID_ARGUMENT, "leaves the buffer of 100 bytes");
  EXPECT_ERROR(buffer->write(std::numeric_limits<uint64_t>::max(), data, 2), KS_ERROR_INVALID_ARGUMENT, "leaves");
  EXPECT_ERROR(buffer->read(50, data, std::numeric_limits<uint64_t>::max()), KS_ERROR_INVALID_ARGUMENT, "leaves");
  EXPECT_ERROR(buffer->write(0, nullptr, 1), KS_ERROR_INVALID_ARGUMENT, "NULL");
  EXPECT_NO_THROW(buffer->write(100, nullptr, 0));
}

TEST_P(EveryDevice, ImpossibleBuffersAreRefused) {
  EXPECT_ERROR(Buffer::create(device_, 0, 0), KS_ERROR_INVALID_ARGUMENT, "0 bytes");
  EXPECT_ERROR(Buffer::create(device_, 16, 0x80), KS_ERROR_INVALID_ARGUMENT, "0x80");
  for (const uint64_t size : {uint64_t{1} << 50, std::numeric_limits<uint64_t>::max()}) {
    try {
      (void)Buffer::create(device_, size, 0);
      ADD_FAILURE() << "a buffer of " << size << " bytes was made";
    } catch (const Error& error) {
      EXPECT_TRUE(error.status() == KS_ERROR_OUT_OF_DEVICE_MEMORY || error.status() == KS_ERROR_OUT_OF_HOST_MEMORY) << error.what();
    }
  }
}

TEST_P(EveryDevice, HostVisibleBuffersAreMapped) {
  const auto buffer = Buffer::create(device_, 64, KS_BUFFER_HOST_VISIBLE);
  ASSERT_NE(buffer->mapped(), nullptr);
  static_cast<uint32_t*>(buffer->mapped())[3] = 77;
  uint32_t value = 0;
  buffer->read(12, &value, 4);
  EXPECT_EQ(value, 77u);
  EXPECT_EQ(buffer->address() != 0, device_->has_vulkan());
}

// Found by fuzz_kuafu under ASan: the caller's memory is the buffer's own, which was imported or mapped.
TEST_P(EveryDevice, BytesAreMovedWithinTheBuffersOwnMemory) {
  constexpr size_t size = 100000, step = 37;
  const auto buffer = Buffer::create(device_, size, KS_BUFFER_HOST_VISIBLE);
  auto* own = static_cast<uint8_t*>(buffer->mapped());
  std::vector<uint8_t> expected(size);
  for (size_t i = 0; i < size; ++i) own[i] = expected[i] = uint8_t(i * 31 >> 3);
  buffer->write(step, own, size - step);
  std::copy_backward(expected.begin(), expected.end() - step, expected.end());
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), own));
  buffer->read(step, own, size - step);
  std::copy(expected.begin() + step, expected.end(), expected.begin());
  EXPECT_TRUE(std::equal(expected.begin(), expected.end(), own));
}

TEST(Buffer, CpuDevicesMapEveryBuffer) {
  SKIP_IF(test::why_no_cpu_device());
  EXPECT_NE(Buffer::create(test::cpu_device(), 64, 0)->mapped(), nullptr);
}

TEST(Buffer, HostBuffersStartAtAPage) {
  const auto buffer = Buffer::create(test::host_device(), 5, 0);
  EXPECT_EQ(reinterpret_cast<uintptr_t>(buffer->mapped()) % 4096, 0u);
}

TEST(Buffer, KeepsItsDeviceAlive) {
  auto device = test::best_device();
  const std::weak_ptr<Device> watch = device;
  auto buffer = Buffer::create(std::move(device), 64, 0);
  EXPECT_FALSE(watch.expired());
  buffer.reset();
  EXPECT_TRUE(watch.expired());
}

}  // namespace
}  // namespace ks
