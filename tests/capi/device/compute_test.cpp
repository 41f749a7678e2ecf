// SPDX-License-Identifier: Apache-2.0
#include "device/compute.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <numeric>
#include <string>
#include <thread>

#include "capi/device/devices.h"
#include "capi/device/expect_error.h"
#include "device/timeline.h"
#include "spirv/multiply.h"

namespace ks {
namespace {

struct Push {
  uint64_t from, to;
  uint32_t count, multiplier;
};

constexpr uint32_t count = 1000;

// 1, 2, 3, ... times factor * multiplier, twice in a row: the second dispatch reads what the first wrote.
std::vector<uint32_t> multiply_twice(const std::shared_ptr<Device>& device, uint32_t factor, uint32_t multiplier) {
  const uint32_t constants[] = {factor};
  const ComputePipeline pipeline(*device, multiply_spirv, sizeof(Push), constants);
  std::vector<uint32_t> values(count);
  std::iota(values.begin(), values.end(), 1);
  const auto a = Buffer::create(device, count * 4, 0), b = Buffer::create(device, count * 4, 0);
  a->write(0, values.data(), count * 4);
  Commands commands(device);
  commands.dispatch(pipeline, Push{a->address(), b->address(), count, multiplier}, (count + 63) / 64);
  commands.dispatch(pipeline, Push{b->address(), a->address(), count, multiplier}, (count + 63) / 64);
  commands.flush();
  a->read(0, values.data(), count * 4);
  return values;
}

class ComputeTest : public testing::Test {
 protected:
  std::shared_ptr<Device> device_ = test::best_device();
};

TEST_F(ComputeTest, DispatchesSeeEachOthersResults) {
  const std::vector<uint32_t> values = multiply_twice(device_, 3, 5);
  for (uint32_t i = 0; i < count; ++i) ASSERT_EQ(values[i], (i + 1) * 225) << i;
}

// A log callback may wait for another thread of its program (an interpreter's lock), which may be using the device.
TEST_F(ComputeTest, TheLogIsToldWhileOtherThreadsMayUseTheDevice) {
  struct Log {
    std::shared_ptr<Device> device;
    std::future<void> other;
    bool logged = false, ran = false;
  } log;
  ks_device_desc desc = ks_device_desc_init();
  desc.cache_directory = "/dev/null/no-folder";
  desc.log_user = &log;
  desc.log = [](void* user, uint32_t, const char* text) {
    Log& self = *static_cast<Log*>(user);
    if (std::string(text).find("could not be written") == std::string::npos) return;
    self.logged = true;
    self.other = std::async(std::launch::async, [device = self.device] {
      const auto buffer = Buffer::create(device, 64, 0);
      Commands commands(device);
      commands.fill(*buffer, 0, 64, 1);
      commands.flush();
    });
    self.ran = self.other.wait_for(std::chrono::seconds(10)) == std::future_status::ready;
  };
  log.device = Device::create(desc, "test");
  (void)multiply_twice(log.device, 3, 5);
  EXPECT_TRUE(log.logged);
  EXPECT_TRUE(log.ran);
  if (log.other.valid()) log.other.wait();
  log.device.reset();
}

TEST_F(ComputeTest, SubmittedWorkReachesItsValueOnTheTimeline) {
  ASSERT_TRUE(Timeline::can_have(*device_));
  const uint32_t constants[] = {3};
  const ComputePipeline pipeline(*device_, multiply_spirv, sizeof(Push), constants);
  const auto a = Buffer::create(device_, count * 4, 0), b = Buffer::create(device_, count * 4, 0);
  const std::vector<uint32_t> ones(count, 1);
  Timeline timeline(device_);
  EXPECT_EQ(timeline.reached(), 0u);
  Commands commands(device_);
  commands.update(*a, 0, ones.data(), count * 4);
  commands.dispatch(pipeline, Push{a->address(), b->address(), count, 5}, (count + 63) / 64);
  commands.submit(timeline, 1, {});
  EXPECT_ERROR(commands.barrier(), KS_ERROR_INTERNAL, "finish()");
  ASSERT_TRUE(timeline.wait(1, UINT64_MAX));
  EXPECT_EQ(timeline.reached(), 1u);
  commands.finish();
  uint32_t last = 0;
  b->read(4 * (count - 1), &last, 4);
  EXPECT_EQ(last, 15u);
  commands.submit(timeline, 2, {});  // nothing was recorded
  ASSERT_TRUE(timeline.wait(2, UINT64_MAX));
  EXPECT_ERROR(commands.update(*Buffer::create(device_, 65540, 0), 0, ones.data(), 65540), KS_ERROR_INTERNAL, "at most 65536");
  EXPECT_ERROR(Timeline(test::host_device()), KS_ERROR_UNSUPPORTED, "no timeline semaphores");
}

TEST_F(ComputeTest, ThreadsMayUseOneDeviceOrTheirOwn) {
  std::vector<std::thread> threads;
  std::atomic<int> right = 0;
  for (uint32_t t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      const auto device = t % 2 ? device_ : test::best_device();
      for (uint32_t repeat = 1; repeat <= 5; ++repeat)
        right += multiply_twice(device, t + 1, repeat)[99] == 100 * (t + 1) * (t + 1) * repeat * repeat;
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 20);
}

TEST_F(ComputeTest, AForkedProcessComputesOnADeviceOfItsOwn) {
  SKIP_IF(test::why_no_cpu_device());
  const auto parents = test::cpu_device(1);
  EXPECT_EQ(multiply_twice(parents, 2, 3)[1], 72u);
  const pid_t child = fork();
  if (child == 0) {
    alarm(20);  // none of the parent's threads is here, whatever waits for one waits for ever
    try {
      _exit(multiply_twice(test::cpu_device(1), 2, 3)[1] == 72u ? 0 : 1);
    } catch (...) {
      _exit(2);
    }
  }
  int status = -1;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
}

TEST_F(ComputeTest, IndirectDispatchTakesItsSizeFromTheBuffer) {
  const ComputePipeline pipeline(*device_, multiply_spirv, sizeof(Push));
  const auto from = Buffer::create(device_, count * 4, 0), to = Buffer::create(device_, count * 4, 0);
  const auto arguments = Buffer::create(device_, 16 + sizeof(VkDispatchIndirectCommand), 0);
  Commands commands(device_);
  commands.fill(*from, 0, count * 4, 7);
  commands.fill(*arguments, 16, sizeof(VkDispatchIndirectCommand), 1);
  commands.dispatch_indirect(pipeline, Push{from->address(), to->address(), count, 1}, *arguments, 16);
  commands.flush();
  uint32_t values[65];
  to->read(0, values, sizeof values);
  EXPECT_EQ(values[63], 7u);
  EXPECT_EQ(values[64], 0u) << "one group of 64 ran, no more";
  EXPECT_ERROR(commands.dispatch_indirect(pipeline, Push{}, *arguments, 17), KS_ERROR_INTERNAL, "leaves");
}

TEST_F(ComputeTest, CommandsMayBeFlushedAndGoOn) {
  const auto buffer = Buffer::create(device_, 64, 0);
  Commands commands(device_);
  commands.flush();
  for (uint32_t i = 1; i <= 3; ++i) {
    commands.fill(*buffer, 0, 64, i);
    commands.flush();
    uint32_t value = 0;
    buffer->read(60, &value, 4);
    EXPECT_EQ(value, i);
  }
}

TEST_F(ComputeTest, CopyMovesAndCounts) {
  const auto from = Buffer::create(device_, 64, 0), to = Buffer::create(device_, 64, 0);
  Commands commands(device_);
  commands.fill(*from, 0, 64, 9);
  commands.copy(*from, 0, *to, 32, 32);
  commands.flush();
  EXPECT_EQ(device_->copied_bytes(), 32u);
  uint32_t values[16];
  to->read(0, values, 64);
  EXPECT_EQ(values[7], 0u);
  EXPECT_EQ(values[8], 9u);
  EXPECT_ERROR(commands.copy(*from, 0, *to, 33, 32), KS_ERROR_INTERNAL, "target");
  EXPECT_ERROR(commands.fill(*to, 2, 4, 0), KS_ERROR_INTERNAL, "multiples of 4");
}

TEST_F(ComputeTest, WrongRequestsAreRefused) {
  const ComputePipeline pipeline(*device_, multiply_spirv, sizeof(Push));
  Commands commands(device_);
  EXPECT_ERROR(commands.dispatch(pipeline, uint32_t{1}, 1), KS_ERROR_INTERNAL, "push constants");
  EXPECT_ERROR(commands.dispatch(pipeline, Push{}, 1, UINT32_MAX), KS_ERROR_INTERNAL, "split it");
  EXPECT_ERROR(ComputePipeline(*device_, multiply_spirv, 1 << 20), KS_ERROR_UNSUPPORTED, "push constants");
  EXPECT_ERROR(ComputePipeline(*device_, multiply_spirv, sizeof(Push), {}, 3), KS_ERROR_UNSUPPORTED, "subgroups of 3");
  EXPECT_NO_THROW(ComputePipeline(*device_, multiply_spirv, sizeof(Push), {}, device_->subgroup_size()));
  EXPECT_ERROR(Commands(test::host_device()), KS_ERROR_UNSUPPORTED, "host device");
}

TEST_F(ComputeTest, StageTimesFollowTheWork) {
  constexpr uint64_t large = 64 << 20;
  const auto buffer = Buffer::create(device_, large, 0);
  Commands commands(device_);
  double fastest_small = 1e9, fastest_large = 1e9;  // of several tries: another process may hold the core in any one
  for (int attempt = 0; attempt < 5; ++attempt) {
    commands.reset_stage_times();
    commands.begin_stage("small");
    commands.fill(*buffer, 0, 64, 1);
    commands.begin_stage("large");
    commands.fill(*buffer, 0, large, 1);
    commands.begin_stage("small");
    commands.fill(*buffer, 0, 64, 1);
    commands.flush();
    commands.add_host_time("host", 3.0);
    const auto times = commands.stage_times();
    ASSERT_EQ(times.size(), 3u);
    EXPECT_EQ(times[0].first, "small");
    EXPECT_EQ(times[1].first, "large");
    EXPECT_EQ(times[2].first, "host");
    EXPECT_EQ(times[2].second, 3.0);
    fastest_small = std::min(fastest_small, times[0].second);
    fastest_large = std::min(fastest_large, times[1].second);
  }
  EXPECT_GT(fastest_large, fastest_small) << "a million times the bytes";
  commands.reset_stage_times();
  EXPECT_TRUE(commands.stage_times().empty());
}

TEST_F(ComputeTest, ManyStagesInOneRecordingAreAllTimed) {
  const auto buffer = Buffer::create(device_, 1 << 20, 0);
  Commands commands(device_);
  for (int i = 0; i < 500; ++i) {  // several query pools
    commands.begin_stage(i % 2 ? "odd" : "even");
    commands.fill(*buffer, 0, 1 << 20, 1);
  }
  commands.flush();
  for (const auto& [name, milliseconds] : commands.stage_times()) EXPECT_GT(milliseconds, 0.0) << name;
}

}  // namespace
}  // namespace ks
