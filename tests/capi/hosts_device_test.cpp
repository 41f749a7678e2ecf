// SPDX-License-Identifier: Apache-2.0
// Both libraries on a Vulkan device that the host program has made: its memory is theirs and theirs is its, without a copy or a file
// descriptor, and what one does waits for the other by timeline semaphores.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>

#include "capi/small_match.h"
#include "capi/small_render.h"
#include "capi/vulkan_host.h"

namespace ks::test {
namespace {

constexpr uint64_t second_ns = 1'000'000'000, soon_ns = 50'000'000, long_ns = 60 * second_ns;

ks_device_desc on(const VulkanHost& host) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_VULKAN, desc.vulkan = &host.desc(), desc.worker_count = 2;
  return desc;
}

ks_sync semaphore_at(VkSemaphore semaphore, uint64_t value) {
  ks_sync sync = ks_sync_init();
  sync.kind = KS_SYNC_SEMAPHORE, sync.handle = reinterpret_cast<uintptr_t>(semaphore), sync.value = value;
  return sync;
}

/// Memory of the host's, as a library imports it.
ks_buffer_desc part_of(const VulkanHost::Memory& memory, uint64_t offset_bytes, uint64_t size_bytes) {
  ks_buffer_desc desc = ks_buffer_desc_init();
  desc.memory = KS_MEMORY_VULKAN, desc.handle = reinterpret_cast<uintptr_t>(memory.memory), desc.memory_type_index = memory.type;
  desc.allocation_bytes = memory.bytes, desc.offset_bytes = offset_bytes, desc.size_bytes = size_bytes;
  return desc;
}

template <class Library>
class HostsDevice : public testing::Test {
 protected:
  void SetUp() override {
    SKIP_IF(host_.device() ? "" : "there is no device with Vulkan 1.2");
    const ks_device_desc desc = on(host_);
    ASSERT_EQ(Library::device_create(&desc, &device_), KS_OK) << Library::last_error();
  }
  void TearDown() override { Library::device_release(device_); }

  VulkanHost host_;
  typename Library::Device device_ = nullptr;
};
using Libraries = testing::Types<Kuafu, Simsense>;
TYPED_TEST_SUITE(HostsDevice, Libraries);

TYPED_TEST(HostsDevice, TheHostWritesIntoTheLibrarysMemory) {
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(4096, KS_BUFFER_HOST_VISIBLE);
  typename TypeParam::Buffer buffer = nullptr;
  ASSERT_EQ(TypeParam::buffer_create(this->device_, &create, &buffer), KS_OK) << TypeParam::last_error();
  ks_buffer_desc desc = ks_buffer_desc_init();
  ASSERT_EQ(TypeParam::buffer_export(buffer, KS_MEMORY_VULKAN, &desc), KS_OK) << TypeParam::last_error();
  EXPECT_GE(desc.allocation_bytes, 4096u);
  this->host_.fill(reinterpret_cast<VkDeviceMemory>(static_cast<uintptr_t>(desc.handle)), 4096, 0xfeedbeef);
  void* mapped = nullptr;
  ASSERT_EQ(TypeParam::buffer_map(buffer, &mapped), KS_OK);
  EXPECT_EQ(static_cast<uint32_t*>(mapped)[1023], 0xfeedbeefu);
  TypeParam::buffer_release(buffer);
}

TYPED_TEST(HostsDevice, TheLibraryWritesIntoTheHostsMemory) {
  const VulkanHost::Memory memory = this->host_.allocate(8192);
  const ks_buffer_desc desc = part_of(memory, 4096, 64);
  typename TypeParam::Buffer buffer = nullptr;
  ASSERT_EQ(TypeParam::buffer_import(this->device_, &desc, &buffer), KS_OK) << TypeParam::last_error();
  const uint32_t words[2] = {7, 8};
  ASSERT_EQ(TypeParam::buffer_write(buffer, 16, words, sizeof words), KS_OK) << TypeParam::last_error();
  EXPECT_EQ(memory.mapped[1024 + 4], 7u);
  EXPECT_EQ(memory.mapped[1024 + 5], 8u);
  EXPECT_EQ(memory.mapped[4], 0u) << "the offset counts";
  ks_buffer_desc again = ks_buffer_desc_init();
  EXPECT_EQ(TypeParam::buffer_export(buffer, KS_MEMORY_VULKAN, &again), KS_ERROR_INVALID_STATE) << "it is the host's own";
  TypeParam::buffer_release(buffer);
  memory.mapped[0] = 1;  // still the host's

  typename TypeParam::Buffer refused = nullptr;
  const auto refuse = [&](auto&& spoil, const char* part) {
    ks_buffer_desc wrong = desc;
    spoil(wrong);
    EXPECT_EQ(TypeParam::buffer_import(this->device_, &wrong, &refused), KS_ERROR_INVALID_ARGUMENT);
    EXPECT_TRUE(says(TypeParam::last_error(), part)) << TypeParam::last_error();
  };
  refuse([](auto& d) { d.handle = 0; }, "NULL");
  refuse([](auto& d) { d.memory_type_index = 31; }, "memory type 31");
  refuse([](auto& d) { d.offset_bytes = 1; }, "does not fit");
  refuse([](auto& d) { d.size_bytes = UINT64_MAX; }, "leave the allocation");
}

TYPED_TEST(HostsDevice, TheQueueIsLockedForEachUse) {
  const int before = this->host_.times_locked();
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(4096, 0);
  typename TypeParam::Buffer buffer = nullptr;
  ASSERT_EQ(TypeParam::buffer_create(this->device_, &create, &buffer), KS_OK);
  const VulkanHost::Memory memory = this->host_.allocate(4096);
  const ks_buffer_desc desc = part_of(memory, 0, 4096);
  typename TypeParam::Buffer theirs = nullptr;
  ASSERT_EQ(TypeParam::buffer_import(this->device_, &desc, &theirs), KS_OK) << TypeParam::last_error();
  uint32_t word = 5;
  ASSERT_EQ(TypeParam::buffer_write(theirs, 0, &word, 4), KS_OK);  // by a copy on the queue
  EXPECT_GT(this->host_.times_locked(), before);
  TypeParam::buffer_release(theirs);
  TypeParam::buffer_release(buffer);
}

/// Both libraries write to their own buffers on the lender's queue, side by side.
template <class Lender, class Borrower>
void expect_one_device_serves_both() {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_CPU, desc.worker_count = 2;
  typename Lender::Device lender = nullptr;
  SKIP_IF(Lender::device_create(&desc, &lender) == KS_OK ? "" : "there is no device with Vulkan 1.2");
  ks_vulkan_device lent = ks_vulkan_device_init();
  ASSERT_EQ(Lender::device_lend(lender, &lent), KS_OK) << Lender::last_error();
  desc.select = KS_SELECT_VULKAN, desc.vulkan = &lent;
  typename Borrower::Device borrower = nullptr;
  ASSERT_EQ(Borrower::device_create(&desc, &borrower), KS_OK) << Borrower::last_error();
  const auto write = [](auto library, auto device, uint32_t first) {
    using Library = decltype(library);
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(64, 0);
    typename Library::Buffer buffer = nullptr;
    EXPECT_EQ(Library::buffer_create(device, &create, &buffer), KS_OK) << Library::last_error();
    for (uint32_t word = first; word < first + 200; ++word) {
      uint32_t read = 0;
      EXPECT_EQ(Library::buffer_write(buffer, 8, &word, 4), KS_OK) << Library::last_error();
      EXPECT_EQ(Library::buffer_read(buffer, 8, &read, 4), KS_OK) << Library::last_error();
      EXPECT_EQ(read, word);
    }
    Library::buffer_release(buffer);
  };
  std::thread beside([&] { write(Borrower{}, borrower, 1000); });
  write(Lender{}, lender, 0);
  beside.join();
  EXPECT_EQ(Borrower::device_lend(borrower, &lent), KS_ERROR_INVALID_STATE);
  EXPECT_TRUE(says(Borrower::last_error(), "is the host's")) << Borrower::last_error();
  Borrower::device_release(borrower);
  Lender::device_release(lender);
}

TEST(LentDevice, KuafuLendsToSimsense) { expect_one_device_serves_both<Kuafu, Simsense>(); }
TEST(LentDevice, SimsenseLendsToKuafu) { expect_one_device_serves_both<Simsense, Kuafu>(); }

TEST(LentDevice, AHostDeviceHasNone) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_HOST;
  simsense_device device = nullptr;
  ASSERT_EQ(simsense_device_create(&desc, &device), KS_OK) << simsense_last_error();
  ks_vulkan_device lent = ks_vulkan_device_init();
  EXPECT_EQ(simsense_device_lend(device, &lent), KS_ERROR_UNSUPPORTED) << simsense_last_error();
  simsense_device_release(device);
}

TYPED_TEST(HostsDevice, WhatTheHostLeftOutIsSaid) {
  typename TypeParam::Device refused = nullptr;
  const auto expect = [&](const ks_device_desc& desc, ks_status status, const char* part) {
    EXPECT_EQ(TypeParam::device_create(&desc, &refused), status) << part;
    EXPECT_TRUE(says(TypeParam::last_error(), part)) << TypeParam::last_error();
  };
  ks_device_desc desc = on(this->host_);
  desc.vulkan = nullptr;
  expect(desc, KS_ERROR_INVALID_ARGUMENT, "vulkan is NULL");
  const auto with = [&](auto&& spoil, ks_status status, const char* part) {
    ks_vulkan_device device = this->host_.desc();
    spoil(device);
    desc.vulkan = &device;
    expect(desc, status, part);
  };
  with([](auto& d) { d.queue = nullptr; }, KS_ERROR_INVALID_ARGUMENT, "NULL among");
  with([](auto& d) { d.create_info = nullptr; }, KS_ERROR_INVALID_ARGUMENT, "NULL among");
  with([](auto& d) { d.queue_family_index = 9; }, KS_ERROR_INVALID_ARGUMENT, "queue_family_index is 9");
  with([](auto& d) { d.api_version = VK_API_VERSION_1_1; }, KS_ERROR_UNSUPPORTED, "needs 1.2");
  VkDeviceCreateInfo other{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
  with([&](auto& d) { d.create_info = &other; }, KS_ERROR_INVALID_ARGUMENT, "sType 1");
  VkPhysicalDeviceVulkan12Features few{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  few.bufferDeviceAddress = VK_TRUE;
  const VulkanHost poor(&few);
  expect(on(poor), KS_ERROR_UNSUPPORTED, "scalarBlockLayout is missing");
}

TYPED_TEST(HostsDevice, WhatIsNoTimelineOfTheDeviceIsRefused) {
  const ks_device_desc any = ks_device_desc_init();
  typename TypeParam::Device own = nullptr;
  ASSERT_EQ(TypeParam::device_create(&any, &own), KS_OK) << TypeParam::last_error();
  ks_buffer_desc desc = ks_buffer_desc_init();
  desc.memory = KS_MEMORY_VULKAN, desc.handle = 1, desc.allocation_bytes = desc.size_bytes = 64;
  typename TypeParam::Buffer buffer = nullptr;
  EXPECT_EQ(TypeParam::buffer_import(own, &desc, &buffer), KS_ERROR_UNSUPPORTED);
  EXPECT_TRUE(says(TypeParam::last_error(), "KS_SELECT_VULKAN")) << TypeParam::last_error();
  TypeParam::device_release(own);
}

/// A small render's depth image in memory that both libraries and the host see.
class Chain : public testing::Test {
 protected:
  static constexpr uint32_t side = SmallRender::side, seen = side * 20 + 20;  // a pixel of the triangle

  void SetUp() override {
    SKIP_IF(host_.device() ? "" : "there is no device with Vulkan 1.2");
    const ks_device_desc desc = on(host_);
    kuafu_device renderer_side = nullptr;
    simsense_device matcher_side = nullptr;
    ASSERT_EQ(kuafu_device_create(&desc, &renderer_side), KS_OK) << kuafu_last_error();
    render_.emplace(KUAFU_TRACER_COMPUTE, renderer_side);
    ASSERT_EQ(simsense_device_create(&desc, &matcher_side), KS_OK) << simsense_last_error();
    match_.emplace(matcher_side, 1, [](simsense_rig_desc& rig) { rig.back_end = SIMSENSE_BACK_END_VULKAN; });
    renderer_ = render_->renderer, engine_ = match_->engine;
    memory_ = host_.allocate(2 * side * side * sizeof(float));
    const ks_buffer_desc shared = part_of(memory_, 0, 2 * side * side * sizeof(float));
    ASSERT_EQ(kuafu_buffer_import(renderer_side, &shared, &rendered_), KS_OK) << kuafu_last_error();
    ASSERT_EQ(simsense_buffer_import(matcher_side, &shared, &matched_), KS_OK) << simsense_last_error();
  }
  void TearDown() override {
    match_.reset();
    simsense_buffer_release(matched_);
    render_.reset();
    kuafu_buffer_release(rendered_);
  }
  [[nodiscard]] float& pixel(uint32_t image, uint32_t at) const {
    return reinterpret_cast<float*>(memory_.mapped)[image * side * side + at];
  }
  /// A render of depth into image 0.
  ks_status submit_render(const ks_sync* wait, ks_sync* out) {
    render_->output.output = KUAFU_OUTPUT_DEPTH, render_->output.buffer = rendered_;
    render_->desc.wait = wait;
    return kuafu_renderer_submit(renderer_, render_->scene, &render_->desc, out);
  }
  /// A match of image 0 with itself, whose rectified left image goes into image 1: the counts are those of image 0.
  ks_status submit_match(const ks_sync* wait, ks_sync* out) {
    const uint64_t shape[2] = {side, side};
    simsense_image image{.buffer = matched_, .host = nullptr, .image = ks_image_desc_packed(KS_FORMAT_F32, 2, shape)};
    simsense_compute_desc desc = simsense_compute_desc_init();
    desc.left = desc.right = image;
    image.image = ks_image_desc_packed(KS_FORMAT_U8, 2, shape);
    image.image.offset_bytes = side * side * sizeof(float);
    const simsense_output_desc output = simsense_output_desc_init(SIMSENSE_OUTPUT_IR_LEFT, image);
    desc.outputs = &output, desc.output_count = 1, desc.wait = wait;
    return simsense_engine_submit(engine_, &desc, out);
  }
  [[nodiscard]] uint8_t count_at(uint32_t at) const { return reinterpret_cast<const uint8_t*>(&pixel(1, 0))[at]; }

  VulkanHost host_;
  std::optional<SmallRender> render_;
  std::optional<SmallMatch> match_;
  kuafu_renderer renderer_ = nullptr;
  simsense_engine engine_ = nullptr;
  kuafu_buffer rendered_ = nullptr;
  simsense_buffer matched_ = nullptr;
  VulkanHost::Memory memory_{};
};

TEST_F(Chain, ARenderWaitsForTheHostAndTheHostForTheRender) {
  const VkSemaphore go = host_.timeline();
  const ks_sync wait = semaphore_at(go, 3);
  ks_sync first = ks_sync_init(), done = ks_sync_init();
  ASSERT_EQ(submit_render(&wait, &first), KS_OK) << kuafu_last_error();
  ASSERT_EQ(kuafu_renderer_export_timeline(renderer_, &done), KS_OK) << kuafu_last_error();
  EXPECT_EQ(done.kind, KS_SYNC_SEMAPHORE);
  EXPECT_EQ(done.value, first.value);
  const auto semaphore = reinterpret_cast<VkSemaphore>(static_cast<uintptr_t>(done.handle));
  host_.signal(go, 2);
  EXPECT_EQ(kuafu_renderer_wait(renderer_, &first, soon_ns), KS_ERROR_TIMEOUT) << "it did not wait for 3";
  EXPECT_FALSE(host_.wait(semaphore, done.value, 0));
  host_.signal(go, 3);
  EXPECT_TRUE(host_.wait(semaphore, done.value, long_ns));
  EXPECT_NEAR(pixel(0, seen), 2.0f, 1e-3f) << "on the host's own mapping";
  EXPECT_EQ(kuafu_renderer_wait(renderer_, &first, long_ns), KS_OK) << kuafu_last_error();
}

TEST_F(Chain, AMatchWaitsForTheHostAndTheHostForTheMatch) {
  const VkSemaphore go = host_.timeline();
  const ks_sync wait = semaphore_at(go, 1);
  ks_sync first = ks_sync_init(), done = ks_sync_init();
  for (uint32_t i = 0; i < side * side; ++i) pixel(0, i) = 0;
  std::atomic<bool> signalled = false;
  std::thread host([&] {
    std::this_thread::sleep_for(std::chrono::nanoseconds(soon_ns));
    for (uint32_t i = 0; i < side * side; ++i) pixel(0, i) = 100;
    signalled = true;
    host_.signal(go, 1);
  });
  EXPECT_EQ(submit_match(&wait, &first), KS_OK) << simsense_last_error();
  EXPECT_TRUE(signalled) << "it did not wait";
  host.join();
  ASSERT_EQ(simsense_engine_export_timeline(engine_, &done), KS_OK) << simsense_last_error();
  EXPECT_EQ(done.kind, KS_SYNC_SEMAPHORE);
  EXPECT_TRUE(host_.wait(reinterpret_cast<VkSemaphore>(static_cast<uintptr_t>(done.handle)), done.value, long_ns));
  EXPECT_EQ(simsense_engine_wait_for(engine_, &first, long_ns), KS_OK) << simsense_last_error();
  EXPECT_EQ(count_at(seen), 100) << "it read its image before the signal";
}

TEST_F(Chain, AMatchWaitsForTheRenderOfTheOtherLibrary) {
  for (uint32_t frame = 0; frame < 3; ++frame) {
    for (uint32_t i = 0; i < side * side; ++i) pixel(0, i) = 0;
    ks_sync rendered = ks_sync_init(), after = ks_sync_init(), matched = ks_sync_init();
    ASSERT_EQ(submit_render(nullptr, &rendered), KS_OK) << kuafu_last_error();
    ASSERT_EQ(kuafu_renderer_export_timeline(renderer_, &after), KS_OK) << kuafu_last_error();
    ASSERT_EQ(submit_match(&after, &matched), KS_OK) << simsense_last_error();
    ASSERT_EQ(simsense_engine_wait_for(engine_, &matched, long_ns), KS_OK) << simsense_last_error();
    EXPECT_EQ(count_at(seen), 2) << "depth in metres, as counts";
    ASSERT_EQ(kuafu_renderer_wait(renderer_, &rendered, 0), KS_OK) << "it had ended before the match began";
  }
}

TEST_F(Chain, AMatchThatWaitsCanBeCancelled) {
  const ks_sync wait = semaphore_at(host_.timeline(), 1);
  ks_sync out = ks_sync_init();
  std::thread host([&] {
    std::this_thread::sleep_for(std::chrono::nanoseconds(soon_ns));
    EXPECT_EQ(simsense_engine_cancel(engine_), KS_OK);
  });
  EXPECT_EQ(submit_match(&wait, &out), KS_ERROR_CANCELLED);
  host.join();
  EXPECT_EQ(submit_match(nullptr, &out), KS_OK) << simsense_last_error();
  EXPECT_EQ(simsense_engine_wait_for(engine_, &out, long_ns), KS_OK) << simsense_last_error();
}

TEST_F(Chain, ARenderThatWaitsCanBeCancelled) {
  const VkSemaphore never = host_.timeline();
  const ks_sync wait = semaphore_at(never, 1);
  ks_sync first = ks_sync_init(), done = ks_sync_init();
  ASSERT_EQ(submit_render(&wait, &first), KS_OK) << kuafu_last_error();
  ASSERT_EQ(kuafu_renderer_export_timeline(renderer_, &done), KS_OK);
  EXPECT_EQ(kuafu_renderer_cancel(renderer_), KS_OK);
  EXPECT_EQ(kuafu_renderer_wait(renderer_, &first, long_ns), KS_ERROR_CANCELLED);
  EXPECT_TRUE(host_.wait(reinterpret_cast<VkSemaphore>(static_cast<uintptr_t>(done.handle)), done.value, long_ns))
      << "whoever waits goes on";
}

TEST_F(Chain, OnlyTimelinesOfOthersAreWaitedFor) {
  ks_sync wrong = ks_sync_init(), out = ks_sync_init();
  wrong.kind = KS_SYNC_TIMELINE, wrong.value = 1;
  EXPECT_EQ(submit_render(&wrong, &out), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(submit_match(&wrong, &out), KS_ERROR_INVALID_ARGUMENT);
  wrong.kind = KS_SYNC_SEMAPHORE;
  EXPECT_EQ(submit_render(&wrong, &out), KS_ERROR_INVALID_ARGUMENT) << "a NULL semaphore";
  wrong.kind = KS_SYNC_TIMELINE_FD, wrong.handle = 123456;
  EXPECT_LT(submit_render(&wrong, &out), 0);
  EXPECT_LT(submit_match(&wrong, &out), 0);
  wrong.kind = KS_SYNC_HOST;
  EXPECT_EQ(submit_render(&wrong, &out), KS_OK) << kuafu_last_error();
  EXPECT_EQ(kuafu_renderer_wait(renderer_, &out, long_ns), KS_OK);
}

/// Timelines by file descriptor, between devices of one driver: lavapipe has none, GPUs do.
TEST(TimelineFd, CrossesFromOneLibraryToTheOther) {
  kuafu_device renderer_side = nullptr;
  SKIP_IF(kuafu_device_create(nullptr, &renderer_side) == KS_OK ? "" : kuafu_last_error());
  ks_device_info info = ks_device_info_init();
  ASSERT_EQ(kuafu_device_get_info(renderer_side, &info), KS_OK);
  kuafu_renderer renderer = nullptr;
  ASSERT_EQ(kuafu_renderer_create(renderer_side, nullptr, &renderer), KS_OK);
  ks_sync timeline = ks_sync_init();
  const ks_status exported = kuafu_renderer_export_timeline(renderer, &timeline);
  const bool can = (info.capabilities & KS_CAP_TIMELINE_FD) != 0;
  EXPECT_EQ(exported, can ? KS_OK : KS_ERROR_UNSUPPORTED) << kuafu_last_error();
  kuafu_renderer_release(renderer);
  kuafu_device_release(renderer_side);
  SKIP_IF(can ? "" : "the device has no KS_CAP_TIMELINE_FD: a GPU's driver has it");
  EXPECT_EQ(timeline.kind, KS_SYNC_TIMELINE_FD);
}

}  // namespace
}  // namespace ks::test
