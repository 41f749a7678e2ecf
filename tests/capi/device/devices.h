// Devices that the tests of the device leaf share.
#pragma once

#include "device/device.h"

namespace ks::test {

/// The CPU device (lavapipe): the tests need a Vulkan device, and that one is everywhere.
inline std::shared_ptr<Device> cpu_device(uint32_t worker_count = 2) {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_CPU;
  desc.worker_count = worker_count;
  return Device::create(desc);
}

/// The best device there is: a GPU where the machine has one.
inline std::shared_ptr<Device> best_device() { return Device::create(ks_device_desc_init()); }

inline std::shared_ptr<Device> host_device() {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_HOST;
  desc.worker_count = 2;
  return Device::create(desc);
}

}  // namespace ks::test
