// SPDX-License-Identifier: Apache-2.0
// Threads and memory that the host lends (ks_host_services): all work and large blocks are the host's, results have the same bits.
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <filesystem>
#include <functional>
#include <iterator>
#include <map>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "capi/small_match.h"
#include "capi/small_render.h"

namespace ks::test {
namespace {

size_t thread_count() {
  return static_cast<size_t>(std::distance(std::filesystem::directory_iterator("/proc/self/task"), std::filesystem::directory_iterator()));
}

/// How a host may run tasks.
enum class Order { side_by_side, backwards, never };

/// A host's threads. Every task notes where it ran.
class Threads {
 public:
  explicit Threads(Order order) : order_(order) {}
  ks_host_services services() {
    ks_host_services host = ks_host_services_init();
    host.parallel_for = [](void* self, uint64_t count, ks_task_fn task, void* work) {
      static_cast<Threads*>(self)->run(count, task, work);
    };
    host.parallel_user = this;
    return host;
  }
  [[nodiscard]] uint64_t calls() const { return calls_; }
  [[nodiscard]] uint64_t most_tasks() const { return most_tasks_; }

 private:
  void run(uint64_t count, ks_task_fn task, void* work) {
    ++calls_;
    for (uint64_t most = most_tasks_; count > most && !most_tasks_.compare_exchange_weak(most, count);) {
    }
    if (order_ == Order::backwards)
      for (uint64_t i = count; i-- > 0;) task(work, i);
    if (order_ != Order::side_by_side) return;
    std::vector<std::thread> threads;
    for (uint64_t i = 0; i < count; ++i) threads.emplace_back([=] { task(work, i); });
    for (std::thread& thread : threads) thread.join();
  }

  const Order order_;
  std::atomic<uint64_t> calls_{0}, most_tasks_{0};
};

/// A host's memory, which notes what it has given.
class Memory {
 public:
  ks_host_services services() {
    ks_host_services host = ks_host_services_init();
    host.allocate = [](void* self, uint64_t bytes, uint64_t alignment) { return static_cast<Memory*>(self)->allocate(bytes, alignment); };
    host.deallocate = [](void* self, void* block, uint64_t bytes, uint64_t alignment) {
      static_cast<Memory*>(self)->deallocate(block, bytes, alignment);
    };
    host.memory_user = this;
    return host;
  }
  void refuse_after(int64_t more) { left_ = more; }
  [[nodiscard]] uint64_t live_bytes() const { return live_bytes_; }
  [[nodiscard]] uint64_t count() const { return count_; }
  [[nodiscard]] bool holds(const void* address) {
    const std::lock_guard lock(mutex_);
    const auto after = live_.upper_bound(reinterpret_cast<uintptr_t>(address));
    if (after == live_.begin()) return false;
    const auto& [begin, block] = *std::prev(after);
    return reinterpret_cast<uintptr_t>(address) < begin + block.first;
  }

 private:
  void* allocate(uint64_t bytes, uint64_t alignment) {
    if (left_-- <= 0) return nullptr;
    void* block = nullptr;
    EXPECT_EQ(alignment & (alignment - 1), 0u);
    if (posix_memalign(&block, alignment, bytes) != 0) return nullptr;
    std::memset(block, 0xa5, bytes);  // it may hold anything
    const std::lock_guard lock(mutex_);
    live_[reinterpret_cast<uintptr_t>(block)] = {bytes, alignment};
    live_bytes_ += bytes;
    ++count_;
    return block;
  }
  void deallocate(void* block, uint64_t bytes, uint64_t alignment) {
    const std::lock_guard lock(mutex_);
    const auto found = live_.find(reinterpret_cast<uintptr_t>(block));
    ASSERT_NE(found, live_.end()) << "a block that was not given";
    EXPECT_EQ(found->second, std::make_pair(bytes, alignment));
    live_bytes_ -= bytes;
    live_.erase(found);
    std::free(block);
  }

  std::mutex mutex_;
  std::map<uintptr_t, std::pair<uint64_t, uint64_t>> live_;  // address: bytes, alignment
  std::atomic<uint64_t> live_bytes_{0}, count_{0};
  std::atomic<int64_t> left_{INT64_MAX};
};

/// nullptr where there is no device; last_error says why.
template <class Library>
typename Library::Device open_lent(uint32_t select, const ks_host_services& host, uint32_t workers = 3) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = select;
  desc.worker_count = workers;
  desc.host = &host;
  typename Library::Device device = nullptr;
  (void)Library::device_create(&desc, &device);
  return device;
}

std::vector<float> rendered(kuafu_device device, uint32_t samples) {
  SmallRender render(KUAFU_TRACER_EMBREE, device);
  render.desc.samples_per_pixel = samples;
  EXPECT_EQ(render.render(), KS_OK) << kuafu_last_error();
  return render.image();
}

std::vector<float> matched(simsense_device device) {
  SmallMatch match(device);
  EXPECT_EQ(simsense_engine_compute(match.engine, &match.desc), KS_OK) << simsense_last_error();
  return match.disparity;
}

/// Runs with memory that ends after 0, 1, 2, ... blocks, until it suffices.
void expect_one_error_until_it_suffices(Memory& memory, const char* (*last_error)(), const std::function<ks_status()>& run) {
  int failures = 0;
  for (;; ++failures) {
    memory.refuse_after(failures);
    const ks_status status = run();
    if (status == KS_OK) break;
    ASSERT_EQ(status, KS_ERROR_OUT_OF_HOST_MEMORY) << last_error();
    EXPECT_TRUE(says(last_error(), "the host's allocate gave nothing for")) << last_error();
    ASSERT_LT(failures, 1000);
  }
  EXPECT_GT(failures, 3);
  memory.refuse_after(INT64_MAX);
}

class HostThreads : public testing::TestWithParam<Order> {};

TEST_P(HostThreads, RunAllOfAMatchAndNoOthersAreStarted) {
  const std::vector<float> own = matched(open_host_device());
  Threads threads(GetParam());
  const size_t before = thread_count();
  const simsense_device device = open_lent<Simsense>(KS_SELECT_HOST, threads.services());
  ASSERT_NE(device, nullptr) << simsense_last_error();
  EXPECT_EQ(thread_count(), before);
  EXPECT_EQ(matched(device), own);
  EXPECT_EQ(thread_count(), before);
  EXPECT_GT(threads.calls(), 0u);
  EXPECT_LE(threads.most_tasks(), 3u);
}

TEST_P(HostThreads, RunAllOfARenderAndNoOthersAreStarted) {
  const kuafu_device first = open_test_device<Kuafu>();
  SKIP_IF(first ? "" : kuafu_last_error());
  const std::vector<float> own = rendered(first, 4);  // after which Embree's threads are there
  Threads threads(GetParam());
  // A device starts threads of its driver: as many with the host's threads as with one worker, which is the caller.
  const auto started = [](const ks_host_services& services, uint32_t workers) {
    const size_t before = thread_count();
    const kuafu_device device = open_lent<Kuafu>(KS_SELECT_CPU, services, workers);
    const std::vector<float> pixels = rendered((kuafu_device_retain(device), device), 4);
    const size_t after = thread_count();
    kuafu_device_release(device);
    return std::make_pair(pixels, after - before);
  };
  EXPECT_EQ(started(threads.services(), 8), started(ks_host_services_init(), 1));
  EXPECT_EQ(started(threads.services(), 8).first, own);
  EXPECT_GT(threads.calls(), 0u);
}

TEST_P(HostThreads, ARenderOnThemIsCancelled) {
  Threads threads(GetParam());
  const kuafu_device device = open_lent<Kuafu>(KS_SELECT_CPU, threads.services());
  SKIP_IF(device ? "" : kuafu_last_error());
  SmallRender render(KUAFU_TRACER_EMBREE, device);
  render.desc.samples_per_pixel = 1 << 20;
  render.desc.progress = [](void*, float) { return 1; };
  EXPECT_EQ(render.render(), KS_ERROR_CANCELLED);
  render.expect_works();
}

INSTANTIATE_TEST_SUITE_P(Orders, HostThreads, testing::Values(Order::side_by_side, Order::backwards, Order::never));

TEST(HostMemoryOfKuafu, IsThatOfEveryBuffer) {
  Memory memory;
  const kuafu_device device = open_lent<Kuafu>(KS_SELECT_CPU, memory.services());
  SKIP_IF(device ? "" : kuafu_last_error());
  {
    SmallRender render(KUAFU_TRACER_EMBREE, (kuafu_device_retain(device), device));
    void* mapped = nullptr;
    ASSERT_EQ(kuafu_buffer_map(render.buffer, &mapped), KS_OK);
    EXPECT_TRUE(memory.holds(mapped));
    render.expect_works();
    EXPECT_GT(memory.count(), 10u);  // the caller's buffer, tables, queues
    uint64_t said = 0;
    ASSERT_EQ(kuafu_device_allocated_bytes(device, &said), KS_OK);
    EXPECT_EQ(memory.live_bytes(), said);
  }
  EXPECT_EQ(memory.live_bytes(), 0u);
  kuafu_device_retain(device);
  EXPECT_EQ(rendered(device, 4), rendered(open_test_device<Kuafu>(), 4));
  kuafu_device_release(device);
}

TEST(HostMemoryOfKuafu, ThatEndsIsOneErrorAndTheRendererStaysUsable) {
  Memory memory;
  const kuafu_device device = open_lent<Kuafu>(KS_SELECT_CPU, memory.services());
  SKIP_IF(device ? "" : kuafu_last_error());
  {
    SmallRender render(KUAFU_TRACER_EMBREE, device);
    render.desc.samples_per_pixel = 4;
    expect_one_error_until_it_suffices(memory, kuafu_last_error, [&] { return render.render(); });
    EXPECT_EQ(render.image(), rendered(open_test_device<Kuafu>(), 4));
  }
  EXPECT_EQ(memory.live_bytes(), 0u);
}

TEST(HostMemoryOfSimsense, IsThatOfBuffersAndOfTheMatcher) {
  const std::vector<float> own = matched(open_host_device());
  Memory memory;
  const simsense_device device = open_lent<Simsense>(KS_SELECT_HOST, memory.services());
  ASSERT_NE(device, nullptr) << simsense_last_error();
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(10000, KS_BUFFER_HOST_VISIBLE);
  simsense_buffer buffer = nullptr;
  void* mapped = nullptr;
  ASSERT_EQ(simsense_buffer_create(device, &create, &buffer), KS_OK) << simsense_last_error();
  ASSERT_EQ(simsense_buffer_map(buffer, &mapped), KS_OK);
  EXPECT_TRUE(memory.holds(mapped));
  for (int i = 0; i < 10000; ++i) ASSERT_EQ(static_cast<char*>(mapped)[i], 0);
  const uint64_t buffers = memory.count();
  EXPECT_EQ(matched((simsense_device_retain(device), device)), own);
  EXPECT_GT(memory.count(), buffers);
  simsense_buffer_release(buffer);
  simsense_device_release(device);
  EXPECT_EQ(memory.live_bytes(), 0u);
}

TEST(HostMemoryOfSimsense, ThatEndsIsOneErrorAndTheEngineStaysUsable) {
  const std::vector<float> own = matched(open_host_device());
  Memory memory;
  const simsense_device device = open_lent<Simsense>(KS_SELECT_HOST, memory.services());
  ASSERT_NE(device, nullptr) << simsense_last_error();
  {
    SmallMatch match(device);
    expect_one_error_until_it_suffices(memory, simsense_last_error, [&] { return simsense_engine_compute(match.engine, &match.desc); });
    EXPECT_EQ(match.disparity, own);
  }
  EXPECT_EQ(memory.live_bytes(), 0u);
}

template <class Library>
class HostServices : public testing::Test {};
using Libraries = testing::Types<Kuafu, Simsense>;
TYPED_TEST_SUITE(HostServices, Libraries);

TYPED_TEST(HostServices, ThatAreIncompleteOrGiveWrongAddressesAreRefused) {
  ks_host_services host = ks_host_services_init();
  host.deallocate = [](void*, void*, uint64_t, uint64_t) {};
  EXPECT_EQ(open_lent<TypeParam>(KS_SELECT_CPU, host), nullptr);
  EXPECT_TRUE(says(TypeParam::last_error(), "host has deallocate, but no allocate")) << TypeParam::last_error();
  host.allocate = [](void*, uint64_t, uint64_t) { return reinterpret_cast<void*>(uintptr_t{8}); };
  const typename TypeParam::Device device = open_lent<TypeParam>(KS_SELECT_CPU, host);
  SKIP_IF(device ? "" : TypeParam::last_error());
  const ks_buffer_create_desc create = ks_buffer_create_desc_init(64, KS_BUFFER_HOST_VISIBLE);
  typename TypeParam::Buffer buffer = nullptr;
  EXPECT_EQ(TypeParam::buffer_create(device, &create, &buffer), KS_ERROR_INVALID_ARGUMENT);
  EXPECT_TRUE(says(TypeParam::last_error(), "no multiple of the 4096 bytes")) << TypeParam::last_error();
  TypeParam::device_release(device);
}

}  // namespace
}  // namespace ks::test
