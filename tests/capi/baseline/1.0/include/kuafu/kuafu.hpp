// SPDX-License-Identifier: Apache-2.0
#ifndef KUAFU_KUAFU_HPP
#define KUAFU_KUAFU_HPP
#include "ks/handle.hpp"
#include "kuafu/kuafu.h"
namespace kuafu {
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
  Buffer(kuafu_device device, uint64_t size_bytes, uint32_t flags) {
    const ks_buffer_create create = ks_buffer_create_init(size_bytes, flags);
    check(kuafu_buffer_create(device, &create, &handle_));
  }
  Buffer(kuafu_device device, const ks_buffer_desc& shared) { check(kuafu_buffer_import(device, &shared, &handle_)); }
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
  explicit Renderer(kuafu_device device, const kuafu_renderer_desc* desc = nullptr) { check(kuafu_renderer_create(device, desc, &handle_)); }
  [[nodiscard]] ks_sync submit(kuafu_scene scene, const kuafu_render_desc& desc) const {
    ks_sync submission = ks_sync_init();
    check(kuafu_renderer_submit(handle_, scene, &desc, &submission));
    return submission;
  }
  [[nodiscard]] bool wait(const ks_sync& submission, uint64_t timeout_ns = UINT64_MAX) const {
    const ks_status status = kuafu_renderer_wait(handle_, &submission, timeout_ns);
    return status != KS_ERROR_TIMEOUT && check(status) == KS_OK;
  }
  void cancel() const { check(kuafu_renderer_cancel(handle_)); }
};
}
#endif
