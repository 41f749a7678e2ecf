// SPDX-License-Identifier: Apache-2.0
// Devices that the tests of the device leaf share.
#pragma once

#include "device/device.h"
#include "device/error.h"
#include "support/skip.h"

namespace ks::test {

/// Why there is no CPU device (lavapipe) here; empty where there is one.
inline const std::string& why_no_cpu_device() {
  static const std::string why = [] {
    ks_device_desc desc = ks_device_desc_init();
    desc.select = KS_SELECT_CPU;
    try {
      (void)Device::create(desc);
    } catch (const Error& error) {
      if (error.status() == KS_ERROR_NO_DEVICE) return std::string(error.what());
      throw;
    }
    return std::string();
  }();
  return why;
}

/// The CPU device. A fixture's member skips the test without one; a test that makes one asks SKIP_IF(why_no_cpu_device()) before.
inline std::shared_ptr<Device> cpu_device(uint32_t worker_count = 2) {
  if (!why_no_cpu_device().empty()) {
    ks_test::skip(why_no_cpu_device());
    return nullptr;
  }
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_CPU;
  desc.worker_count = worker_count;
  return Device::create(desc);
}

/// The best device there is: a GPU where the machine has one.
inline std::shared_ptr<Device> best_device() { return Device::create(ks_device_desc_init()); }

/// The same for all tests of a program.
inline const std::shared_ptr<Device>& shared_best_device() {
  static const std::shared_ptr<Device> opened = best_device();
  return opened;
}

inline std::shared_ptr<Device> host_device() {
  ks_device_desc desc = ks_device_desc_init();
  desc.select = KS_SELECT_HOST;
  desc.worker_count = 2;
  return Device::create(desc);
}

}  // namespace ks::test
