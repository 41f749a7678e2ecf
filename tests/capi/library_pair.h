// SPDX-License-Identifier: Apache-2.0
// Both libraries' device and buffer functions as one set of names, so that a test written once runs on each.
#pragma once

#include <cstdlib>
#include <cstring>

#include "kuafu/kuafu.h"
#include "simsense/simsense.h"
#include "support/skip.h"

namespace ks::test {

#define KS_TEST_LIBRARY(Type, prefix)                                               \
  struct Type {                                                                     \
    using Device = prefix##_device;                                                 \
    using Buffer = prefix##_buffer;                                                 \
    static constexpr const char* name = #prefix;                                    \
    static constexpr auto last_error = prefix##_last_error;                         \
    static constexpr auto version = prefix##_version;                               \
    static constexpr auto device_enumerate = prefix##_device_enumerate;             \
    static constexpr auto device_create = prefix##_device_create;                   \
    static constexpr auto device_get_info = prefix##_device_get_info;               \
    static constexpr auto device_retain = prefix##_device_retain;                   \
    static constexpr auto device_release = prefix##_device_release;                 \
    static constexpr auto device_copied_bytes = prefix##_device_copied_bytes;       \
    static constexpr auto device_lend = prefix##_device_lend;                       \
    static constexpr auto device_allocated_bytes = prefix##_device_allocated_bytes; \
    static constexpr auto buffer_create = prefix##_buffer_create;                   \
    static constexpr auto buffer_import = prefix##_buffer_import;                   \
    static constexpr auto buffer_export = prefix##_buffer_export;                   \
    static constexpr auto buffer_map = prefix##_buffer_map;                         \
    static constexpr auto buffer_write = prefix##_buffer_write;                     \
    static constexpr auto buffer_read = prefix##_buffer_read;                       \
    static constexpr auto buffer_retain = prefix##_buffer_retain;                   \
    static constexpr auto buffer_release = prefix##_buffer_release;                 \
  }

KS_TEST_LIBRARY(Kuafu, kuafu);
KS_TEST_LIBRARY(Simsense, simsense);

/// The CPU Vulkan device, or with ACTIVESTEREO_TEST_DEVICE=auto the best one (a GPU); nullptr without one (last_error says why).
template <class Library>
typename Library::Device open_test_device() {
  ks_device_desc desc = ks_device_desc_init();
  const char* choice = std::getenv("ACTIVESTEREO_TEST_DEVICE");
  desc.select = choice != nullptr && std::strcmp(choice, "auto") == 0 ? KS_SELECT_AUTO : KS_SELECT_CPU;
  desc.worker_count = 2;
  typename Library::Device device = nullptr;
  (void)Library::device_create(&desc, &device);
  return device;
}

inline bool says(const char* text, const char* part) { return std::strstr(text, part) != nullptr; }

}  // namespace ks::test
