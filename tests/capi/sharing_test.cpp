// SPDX-License-Identifier: Apache-2.0
// kuafu's memory seen through simsense: the same bytes, with no copy on either side.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>

#include "capi/library_pair.h"
#include "capi/small_match.h"

namespace ks::test {
namespace {

constexpr uint64_t size_bytes = 960 * 540 * 2;

class Sharing : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_IF(renderer_side_ ? "" : kuafu_last_error());
    ASSERT_NE(matcher_side_, nullptr) << simsense_last_error();
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(size_bytes, KS_BUFFER_EXPORTABLE | KS_BUFFER_HOST_VISIBLE);
    ASSERT_EQ(kuafu_buffer_create(renderer_side_, &create, &source_), KS_OK) << kuafu_last_error();
  }
  void TearDown() override {
    simsense_buffer_release(view_);
    kuafu_buffer_release(source_);
    simsense_device_release(matcher_side_);
    kuafu_device_release(renderer_side_);
  }
  uint64_t copied_bytes() const {
    uint64_t renderer = 0, matcher = 0;
    EXPECT_EQ(kuafu_device_copied_bytes(renderer_side_, &renderer), KS_OK);
    EXPECT_EQ(simsense_device_copied_bytes(matcher_side_, &matcher), KS_OK);
    return renderer + matcher;
  }
  // Writes through each side's mapping and reads through the other's.
  void expect_same_memory() {
    void *ours = nullptr, *theirs = nullptr;
    ASSERT_EQ(kuafu_buffer_map(source_, &ours), KS_OK) << kuafu_last_error();
    ASSERT_EQ(simsense_buffer_map(view_, &theirs), KS_OK) << simsense_last_error();
    std::strcpy(static_cast<char*>(ours) + size_bytes - 16, "kuafu wrote");
    EXPECT_STREQ(static_cast<char*>(theirs) + size_bytes - 16, "kuafu wrote");
    std::strcpy(static_cast<char*>(theirs), "simsense wrote");
    EXPECT_STREQ(static_cast<char*>(ours), "simsense wrote");
    EXPECT_EQ(copied_bytes(), 0u);
  }
  kuafu_device renderer_side_ = open_test_device<Kuafu>();
  simsense_device matcher_side_ = open_test_device<Simsense>();
  kuafu_buffer source_ = nullptr;
  simsense_buffer view_ = nullptr;
};

TEST_F(Sharing, OpaqueFdIsOneMemoryWithoutACopy) {
  ks_buffer_desc desc = ks_buffer_desc_init(), again = ks_buffer_desc_init();
  ASSERT_EQ(kuafu_buffer_export(source_, KS_MEMORY_OPAQUE_FD, &desc), KS_OK) << kuafu_last_error();
  ASSERT_EQ(kuafu_buffer_export(source_, KS_MEMORY_OPAQUE_FD, &again), KS_OK) << kuafu_last_error();
  EXPECT_NE(desc.handle, again.handle) << "each export gives a fresh fd";
  struct stat first {
  }, second{};
  ASSERT_EQ(fstat(static_cast<int>(desc.handle), &first), 0);
  ASSERT_EQ(fstat(static_cast<int>(again.handle), &second), 0);
  EXPECT_EQ(first.st_ino, second.st_ino);
  EXPECT_EQ(first.st_dev, second.st_dev);
  EXPECT_EQ(desc.offset_bytes, again.offset_bytes);
  ASSERT_EQ(simsense_buffer_import(matcher_side_, &desc, &view_), KS_OK) << simsense_last_error();
  EXPECT_EQ(fstat(static_cast<int>(desc.handle), &first), 0) << "import leaves the caller's fd open";
  close(static_cast<int>(desc.handle));
  close(static_cast<int>(again.handle));
  expect_same_memory();
}

// Memory that is the device's own, so that it is read and written by each side's own copies instead of mappings.
TEST(DmaBuf, IsOneMemoryOfBothLibraries) {
  const kuafu_device renderer_side = open_test_device<Kuafu>();
  SKIP_IF(renderer_side ? "" : kuafu_last_error());
  ks_device_info info = ks_device_info_init();
  ASSERT_EQ(kuafu_device_get_info(renderer_side, &info), KS_OK);
  const uint64_t both_ways = KS_CAP_EXPORT_DMA_BUF | KS_CAP_IMPORT_DMA_BUF;
  const bool shares = (info.capabilities & both_ways) == both_ways;
  if (!shares) kuafu_device_release(renderer_side);
  SKIP_IF(shares ? "" : "the device does not share memory by dma-buf (ACTIVESTEREO_TEST_DEVICE=auto tries a GPU)");
  const simsense_device matcher_side = open_test_device<Simsense>();
  ASSERT_NE(matcher_side, nullptr) << simsense_last_error();
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(size_bytes, KS_BUFFER_DMA_BUF);
  kuafu_buffer source = nullptr;
  simsense_buffer view = nullptr;
  ASSERT_EQ(kuafu_buffer_create(renderer_side, &create, &source), KS_OK) << kuafu_last_error();
  ks_buffer_desc desc = ks_buffer_desc_init();
  EXPECT_EQ(kuafu_buffer_export(source, KS_MEMORY_OPAQUE_FD, &desc), KS_ERROR_INVALID_STATE) << "it was not made to be an opaque fd";
  ASSERT_EQ(kuafu_buffer_export(source, KS_MEMORY_DMA_BUF, &desc), KS_OK) << kuafu_last_error();
  ASSERT_EQ(simsense_buffer_import(matcher_side, &desc, &view), KS_OK) << simsense_last_error();
  close(static_cast<int>(desc.handle));  // each side has its own since
  char read[16] = {};
  ASSERT_EQ(kuafu_buffer_write(source, size_bytes - 16, "kuafu wrote", 12), KS_OK) << kuafu_last_error();
  ASSERT_EQ(simsense_buffer_read(view, size_bytes - 16, read, 12), KS_OK) << simsense_last_error();
  EXPECT_STREQ(read, "kuafu wrote");
  ASSERT_EQ(simsense_buffer_write(view, 0, "simsense wrote", 15), KS_OK) << simsense_last_error();
  ASSERT_EQ(kuafu_buffer_read(source, 0, read, 15), KS_OK) << kuafu_last_error();
  EXPECT_STREQ(read, "simsense wrote");
  simsense_buffer_release(view);
  kuafu_buffer_release(source);
  simsense_device_release(matcher_side);
  kuafu_device_release(renderer_side);
}

TEST_F(Sharing, HostPointerIsOneMemoryWithoutACopyAlsoOnTheHostDevice) {
  ks_buffer_desc desc = ks_buffer_desc_init();
  ASSERT_EQ(kuafu_buffer_export(source_, KS_MEMORY_HOST, &desc), KS_OK) << kuafu_last_error();
  for (const simsense_device device : {matcher_side_, open_host_device()}) {
    matcher_side_ = device;
    ASSERT_EQ(simsense_buffer_import(matcher_side_, &desc, &view_), KS_OK) << simsense_last_error();
    void *ours = nullptr, *theirs = nullptr;
    ASSERT_EQ(kuafu_buffer_map(source_, &ours), KS_OK);
    ASSERT_EQ(simsense_buffer_map(view_, &theirs), KS_OK);
    EXPECT_EQ(ours, theirs);
    expect_same_memory();
    simsense_buffer_release(view_), view_ = nullptr;
    simsense_device_release(matcher_side_), matcher_side_ = nullptr;
  }
}

}  // namespace
}  // namespace ks::test
