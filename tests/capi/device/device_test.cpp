// SPDX-License-Identifier: Apache-2.0
#include "device/device.h"

#include <gtest/gtest.h>

#include <thread>

#include "capi/device/devices.h"
#include "capi/device/expect_error.h"
#include "device/physical.h"
#include "device/thread_pool.h"

namespace ks {
namespace {

ks_device_info device_of(uint32_t index, uint32_t kind, const char* refused = "") {
  ks_device_info info = ks_device_info_init();
  info.index = index;
  info.kind = kind;
  info.usable = *refused == '\0';
  std::snprintf(info.name, sizeof info.name, "device-%u", index);
  std::snprintf(info.refused, sizeof info.refused, "%s", refused);
  info.device_uuid[0] = static_cast<uint8_t>(index + 1);
  return info;
}

ks_device_desc choose(uint32_t select, uint32_t index = 0) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = select;
  desc.index = index;
  return desc;
}

PhysicalFacts usable_facts() {
  PhysicalFacts facts;
  facts.api_version = VK_API_VERSION_1_2;
  facts.queue_family = 0;
  facts.features12.bufferDeviceAddress = facts.features12.scalarBlockLayout = VK_TRUE;
  return facts;
}

TEST(Refusal, NamesEveryMissingThing) {
  EXPECT_EQ(refusal(usable_facts()), "");
  PhysicalFacts facts = usable_facts();
  facts.queue_family = UINT32_MAX;
  facts.features12.bufferDeviceAddress = facts.features12.scalarBlockLayout = VK_FALSE;
  const std::string all = refusal(facts);
  for (const char* part : {"compute queue", "bufferDeviceAddress", "scalarBlockLayout"})
    EXPECT_NE(all.find(part), std::string::npos) << all;
  facts.api_version = VK_MAKE_API_VERSION(0, 1, 1, 200);
  const std::string old = refusal(facts);
  for (const char* part : {"compute queue", "Vulkan 1.1", "1.2"}) EXPECT_NE(old.find(part), std::string::npos) << old;
}

TEST(SelectDevice, AutoTakesTheBestUsableKind) {
  const std::vector<ks_device_info> devices = {device_of(0, KS_DEVICE_KIND_CPU), device_of(1, KS_DEVICE_KIND_INTEGRATED_GPU),
                                               device_of(2, KS_DEVICE_KIND_DISCRETE_GPU, "feature scalarBlockLayout is missing"),
                                               device_of(3, KS_DEVICE_KIND_INTEGRATED_GPU)};
  EXPECT_EQ(select_device(devices, choose(KS_SELECT_AUTO), ""), 1u);
  EXPECT_EQ(select_device(devices, choose(KS_SELECT_CPU), ""), 0u);
  EXPECT_EQ(select_device(devices, choose(KS_SELECT_INDEX, 3), ""), 3u);
  ks_device_desc by_uuid = choose(KS_SELECT_UUID);
  by_uuid.uuid[0] = 4;
  EXPECT_EQ(select_device(devices, by_uuid, ""), 3u);
}

TEST(SelectDevice, FailureNamesEveryDeviceAndItsReasons) {
  const std::vector<ks_device_info> devices = {
      device_of(0, KS_DEVICE_KIND_DISCRETE_GPU, "no compute queue; feature scalarBlockLayout is missing"),
      device_of(1, KS_DEVICE_KIND_INTEGRATED_GPU, "Vulkan 1.0")};
  for (const ks_device_desc& desc :
       {choose(KS_SELECT_AUTO), choose(KS_SELECT_CPU), choose(KS_SELECT_INDEX, 0), choose(KS_SELECT_INDEX, 9), choose(KS_SELECT_UUID)}) {
    EXPECT_ERROR(select_device(devices, desc, ""), KS_ERROR_NO_DEVICE, "device-0: refused, no compute queue; feature scalarBlockLayout");
    EXPECT_ERROR(select_device(devices, desc, ""), KS_ERROR_NO_DEVICE, "device-1: refused, Vulkan 1.0");
    EXPECT_ERROR(select_device(devices, desc, ""), KS_ERROR_NO_DEVICE, "mesa-vulkan-drivers");
  }
  EXPECT_ERROR(select_device({}, choose(KS_SELECT_AUTO), "the loader was not found"), KS_ERROR_NO_DEVICE, "the loader was not found");
  EXPECT_ERROR(select_device(devices, choose(77), ""), KS_ERROR_INVALID_ARGUMENT, "77");
}

TEST(Device, CpuDeviceSharesMemoryBothWays) {
  SKIP_IF(test::why_no_cpu_device());
  const auto device = test::cpu_device();
  EXPECT_TRUE(device->is_cpu());
  EXPECT_TRUE(device->has_vulkan());
  EXPECT_GT(device->info().memory_bytes, 0u);
  const uint64_t both = KS_CAP_EXPORT_OPAQUE_FD | KS_CAP_IMPORT_OPAQUE_FD | KS_CAP_IMPORT_HOST_POINTER;
  EXPECT_EQ(device->info().capabilities & both, both);
  EXPECT_TRUE(device->has_extension(VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME));
}

TEST(Device, HostDeviceHasNoVulkan) {
  const auto device = test::host_device();
  EXPECT_FALSE(device->has_vulkan());
  EXPECT_TRUE(device->is_cpu());
  EXPECT_EQ(device->info().kind, KS_DEVICE_KIND_HOST);
  EXPECT_EQ(device->workers().size(), 2u);
}

TEST(Device, AbsurdWorkerCountIsRefused) {
  ks_device_desc desc = choose(KS_SELECT_HOST);
  desc.worker_count = 4000000000u;
  EXPECT_ERROR(Device::create(desc), KS_ERROR_INVALID_ARGUMENT, "4000000000");
}

TEST(Device, MemoryTypeIsRefusedWhereThereIsNone) {
  const auto device = test::best_device();
  EXPECT_ERROR(device->memory_type(0, 0, 0), KS_ERROR_UNSUPPORTED, "memory type");
}

TEST(Device, ManyDevicesLiveAtOnceOnManyThreads) {
  SKIP_IF(test::why_no_cpu_device());
  std::vector<std::thread> threads;
  std::atomic<int> created = 0;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&created] {
      for (int repeat = 0; repeat < 3; ++repeat) {
        const auto a = test::cpu_device(1), b = test::cpu_device(1);
        created += a->handle() != b->handle();
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(created, 12);
}

TEST(Device, LogReachesTheCallback) {
  std::vector<std::string> lines;
  ks_device_desc desc = choose(KS_SELECT_AUTO);
  desc.log = [](void* user, uint32_t, const char* text) { static_cast<std::vector<std::string>*>(user)->push_back(text); };
  desc.log_user = &lines;
  const auto device = Device::create(desc);
  ASSERT_FALSE(lines.empty());
  EXPECT_NE(lines.back().find(device->info().name), std::string::npos);
}

}  // namespace
}  // namespace ks
