// SPDX-License-Identifier: Apache-2.0
/* kuafu for C++17: owners of its handles, and errors as exceptions. Structs, constants and all other functions are those of kuafu.h:
 *
 *   kuafu::Device device;  kuafu::Scene scene(device);  kuafu::check(kuafu_scene_load(scene, "room.glb", nullptr, nullptr));
 *
 * Every constructor throws ks::Error. Copies share the object; the threading rules of kuafu.h hold. */
#ifndef KUAFU_KUAFU_HPP
#define KUAFU_KUAFU_HPP

#include "ks/handle.hpp"
#include "kuafu/kuafu.h"

namespace kuafu {

/* Throws what a call to kuafu failed with; benign statuses are returned. */
inline ks_status check(ks_status status) {
  if (status < 0) throw ks::Error(status, kuafu_last_error());
  return status;
}

class Device : public ks::Reference<kuafu_device, kuafu_device_retain, kuafu_device_release> {
 public:
  explicit Device(const ks_device_desc& desc = ks_device_desc_init()) { check(kuafu_device_create(&desc, &handle_)); }
  [[nodiscard]] ks_device_info info() const {
    ks_device_info info = ks_device_info_init();
    check(kuafu_device_get_info(handle_, &info));
    return info;
  }
};

class Buffer : public ks::Reference<kuafu_buffer, kuafu_buffer_retain, kuafu_buffer_release> {
 public:
  /* flags: KS_BUFFER_*. */
  Buffer(kuafu_device device, uint64_t size_bytes, uint32_t flags) {
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(size_bytes, flags);
    check(kuafu_buffer_create(device, &create, &handle_));
  }
  /* Imports what another library or device exported. */
  Buffer(kuafu_device device, const ks_buffer_desc& shared) { check(kuafu_buffer_import(device, &shared, &handle_)); }
  /* memory: KS_MEMORY_*. A file descriptor in it is the caller's to close. */
  [[nodiscard]] ks_buffer_desc export_as(uint32_t memory) const {
    ks_buffer_desc desc = ks_buffer_desc_init();
    check(kuafu_buffer_export(handle_, memory, &desc));
    return desc;
  }
  [[nodiscard]] void* map() const {
    void* address = nullptr;
    check(kuafu_buffer_map(handle_, &address));
    return address;
  }
};

class Scene : public ks::Reference<kuafu_scene, kuafu_scene_retain, kuafu_scene_release> {
 public:
  explicit Scene(kuafu_device device) { check(kuafu_scene_create(device, &handle_)); }
};

class Renderer : public ks::Reference<kuafu_renderer, kuafu_renderer_retain, kuafu_renderer_release> {
 public:
  /* desc null: the tracer that suits the device. */
  explicit Renderer(kuafu_device device, const kuafu_renderer_desc* desc = nullptr) { check(kuafu_renderer_create(device, desc, &handle_)); }
  /* Starts a render; wait takes what it returns. */
  [[nodiscard]] ks_sync submit(kuafu_scene scene, const kuafu_render_desc& desc) const {
    ks_sync submission = ks_sync_init();
    check(kuafu_renderer_submit(handle_, scene, &desc, &submission));
    return submission;
  }
  /* Whether it has ended; throws what the render failed with. */
  [[nodiscard]] bool wait(const ks_sync& submission, uint64_t timeout_ns = UINT64_MAX) const {
    const ks_status status = kuafu_renderer_wait(handle_, &submission, timeout_ns);
    return status != KS_ERROR_TIMEOUT && check(status) == KS_OK;
  }
  void cancel() const { check(kuafu_renderer_cancel(handle_)); }
};

} /* namespace kuafu */

#endif
