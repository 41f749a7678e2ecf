// SPDX-License-Identifier: Apache-2.0
// Buffers of a device: memory, bounds, mapping, sharing with other devices.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <numeric>

#include "capi/device/devices.h"
#include "capi/device/expect_error.h"
#include "device/buffer.h"
#include "device/compute.h"
#include "support/heap.h"

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

// An exported descriptor whose fd is closed at the end, as its caller must.
struct Exported {
  explicit Exported(const Buffer& buffer) : desc(buffer.export_as(KS_MEMORY_OPAQUE_FD)) {}
  ~Exported() { close(static_cast<int>(desc.handle)); }
  ks_buffer_desc desc;
};

class SharingTest : public testing::Test {
 protected:
  std::shared_ptr<Device> exporter_ = test::cpu_device(), importer_ = test::cpu_device();
  std::shared_ptr<Buffer> source_ = exporter_ ? Buffer::create(exporter_, 1000, KS_BUFFER_EXPORTABLE | KS_BUFFER_HOST_VISIBLE) : nullptr;
};

TEST(DeviceLocalSharing, OpaqueFdIsTheSameMemoryOnTheBestDevice) {
  const auto exporter = test::best_device(), importer = test::best_device();
  const auto source = Buffer::create(exporter, 1000, KS_BUFFER_EXPORTABLE);
  const Exported exported(*source);
  const auto view = Buffer::import(importer, exported.desc);
  uint32_t value = 0xfeed;
  source->write(996, &value, 4);
  value = 0;
  view->read(996, &value, 4);
  EXPECT_EQ(value, 0xfeedu);
}

TEST(DeviceLocalSharing, HostMemoryIsImportedByTheBestDevice) {
  const auto device = test::best_device();
  const auto source = Buffer::create(test::host_device(), 5000, 0);
  const auto view = Buffer::import(device, source->export_as(KS_MEMORY_HOST));
  Commands commands(device);
  commands.fill(*view, 4096, 4, 0xfeed);
  commands.flush();
  uint32_t value = 0;
  source->read(4096, &value, 4);
  EXPECT_EQ(value, 0xfeedu);
}

TEST_F(SharingTest, ImportOutlivesExporter) {
  std::shared_ptr<Buffer> copy;
  {
    const Exported exported(*source_);
    copy = Buffer::import(importer_, exported.desc);
  }
  std::strcpy(static_cast<char*>(source_->mapped()), "mark");
  source_.reset();
  exporter_.reset();
  EXPECT_STREQ(static_cast<char*>(copy->mapped()), "mark");
}

TEST_F(SharingTest, FdsAreClosedOnExecAndNoneLeaks) {
  const size_t before = test::open_files();
  {
    const Exported exported(*source_);
    EXPECT_TRUE(fcntl(static_cast<int>(exported.desc.handle), F_GETFD) & FD_CLOEXEC);
    const auto copy = Buffer::import(importer_, exported.desc);
    ks_buffer_desc wrong = exported.desc;
    wrong.size_bytes = wrong.allocation_bytes = 500;
    EXPECT_ERROR(Buffer::import(importer_, wrong), KS_ERROR_INVALID_ARGUMENT, "dedicated");
  }
  EXPECT_EQ(test::open_files(), before);
}

TEST_F(SharingTest, EveryWrongFieldOfADescriptorIsRefused) {
  const Exported exported(*source_);
  const auto refused = [&](auto&& spoil, const char* part) {
    ks_buffer_desc desc = exported.desc;
    spoil(desc);
    EXPECT_ERROR(Buffer::import(importer_, desc), KS_ERROR_INVALID_ARGUMENT, part);
  };
  refused([](auto& d) { d.device_uuid[3] ^= 1; }, "UUID");
  refused([](auto& d) { d.driver_uuid[3] ^= 1; }, "UUID");
  refused([](auto& d) { d.memory_type_index = 31; }, "memory type 31");
  refused([](auto& d) { d.memory_type_index = 4000000000u; }, "memory type");
  refused([](auto& d) { d.size_bytes = 0; }, "size_bytes is 0");
  refused([](auto& d) { d.size_bytes = d.allocation_bytes + 1; }, "leave the allocation");
  refused([](auto& d) { d.offset_bytes = UINT64_MAX; }, "leave the allocation");
  refused([](auto& d) { d.offset_bytes = 16, d.size_bytes = 16; }, "does not fit");
  refused([](auto& d) { d.dedicated = 0, d.offset_bytes = 1, d.size_bytes = 16; }, "does not fit");
  refused([](auto& d) { d.allocation_bytes = d.size_bytes = 1 << 20; }, "holds");
  refused([](auto& d) { d.handle = 123456; }, "fd 123456");
  refused([](auto& d) { d.handle = UINT64_MAX; }, "fd 1844");
  refused([](auto& d) { d.memory = 9; }, "memory is 9");
}

TEST_F(SharingTest, AForeignFileIsRefused) {
  const Exported exported(*source_);
  const int file = memfd_create("not device memory", MFD_CLOEXEC);
  ASSERT_EQ(ftruncate(file, 1 << 16), 0);
  ks_buffer_desc desc = exported.desc;
  desc.handle = static_cast<uint64_t>(file);
  EXPECT_ERROR(Buffer::import(importer_, desc), KS_ERROR_INVALID_ARGUMENT, "VK_ERROR_INVALID_EXTERNAL_HANDLE");
  close(file);
}

TEST_F(SharingTest, OnlyExportableBuffersAreExported) {
  EXPECT_ERROR(Buffer::create(exporter_, 64, 0)->export_as(KS_MEMORY_OPAQUE_FD), KS_ERROR_INVALID_STATE, "KS_BUFFER_EXPORTABLE");
  EXPECT_ERROR(source_->export_as(7), KS_ERROR_INVALID_ARGUMENT, "memory is 7");
  EXPECT_ERROR(Buffer::create(test::host_device(), 64, KS_BUFFER_EXPORTABLE), KS_ERROR_UNSUPPORTED, "KS_MEMORY_HOST");
}

TEST_F(SharingTest, PartOfHostMemoryIsImportedWhereAlignmentPermits) {
  const auto host = test::host_device();
  const auto source = Buffer::create(host, 3 * 4096, 0);
  ks_buffer_desc desc = source->export_as(KS_MEMORY_HOST);
  desc.offset_bytes = 4096;
  desc.size_bytes = 256;
  for (const auto& to : {importer_, host}) EXPECT_EQ(Buffer::import(to, desc)->mapped(), static_cast<char*>(source->mapped()) + 4096);
  desc.offset_bytes = 4097;
  EXPECT_ERROR(Buffer::import(importer_, desc), KS_ERROR_INVALID_ARGUMENT, "aligned");
  EXPECT_NO_THROW(Buffer::import(host, desc));
  desc.offset_bytes = 3 * 4096;
  EXPECT_ERROR(Buffer::import(host, desc), KS_ERROR_INVALID_ARGUMENT, "leave the allocation");
  desc = source->export_as(KS_MEMORY_HOST);
  desc.handle = 0;
  EXPECT_ERROR(Buffer::import(host, desc), KS_ERROR_INVALID_ARGUMENT, "host pointer 0x0");
  desc.handle = UINT64_MAX;
  EXPECT_ERROR(Buffer::import(host, desc), KS_ERROR_INVALID_ARGUMENT, "host pointer");
}

}  // namespace
}  // namespace ks
