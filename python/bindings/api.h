// SPDX-License-Identifier: Apache-2.0
// What the two libraries have in common, as a type: the templates beside this file bind either of them. They never meet in one module.
#pragma once

#include <pybind11/pybind11.h>

#include <utility>

#include "ks/buffer.h"
#include "ks/device.h"
#include "ks/image.h"
#include "ks/log.h"
#include "ks/status.h"

namespace py = pybind11;

#define KS_BINDING_API(Type, prefix)                                                 \
  struct Type {                                                                      \
    static constexpr const char* name = #prefix;                                     \
    using DeviceHandle = prefix##_device;                                            \
    using BufferHandle = prefix##_buffer;                                            \
    static constexpr auto last_error = &prefix##_last_error;                         \
    static constexpr auto device_enumerate = &prefix##_device_enumerate;             \
    static constexpr auto device_create = &prefix##_device_create;                   \
    static constexpr auto device_get_info = &prefix##_device_get_info;               \
    static constexpr auto device_release = &prefix##_device_release;                 \
    static constexpr auto device_copied_bytes = &prefix##_device_copied_bytes;       \
    static constexpr auto device_allocated_bytes = &prefix##_device_allocated_bytes; \
    static constexpr auto device_lend = &prefix##_device_lend;                       \
    static constexpr auto buffer_create = &prefix##_buffer_create;                   \
    static constexpr auto buffer_import = &prefix##_buffer_import;                   \
    static constexpr auto buffer_export = &prefix##_buffer_export;                   \
    static constexpr auto buffer_map = &prefix##_buffer_map;                         \
    static constexpr auto buffer_write = &prefix##_buffer_write;                     \
    static constexpr auto buffer_read = &prefix##_buffer_read;                       \
    static constexpr auto buffer_release = &prefix##_buffer_release;                 \
  }

namespace ks_python {

/// Owns one reference to a C handle.
template <class T, void (*release)(T)>
class Handle {
 public:
  Handle() = default;
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  Handle(Handle&& other) noexcept : handle_(std::exchange(other.handle_, nullptr)) {}
  ~Handle() { release(handle_); }
  [[nodiscard]] T get() const { return handle_; }
  [[nodiscard]] T* put() { return &handle_; }
  void reset() { release(std::exchange(handle_, nullptr)); }

 private:
  T handle_ = nullptr;
};

}  // namespace ks_python
