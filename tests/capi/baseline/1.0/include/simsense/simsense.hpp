// SPDX-License-Identifier: Apache-2.0
#ifndef SIMSENSE_SIMSENSE_HPP
#define SIMSENSE_SIMSENSE_HPP
#include "ks/handle.hpp"
#include "simsense/simsense.h"
namespace simsense {
inline ks_status check(ks_status status) {
  if (status < 0) throw ks::Error(status, simsense_last_error());
  return status;
}
class Device : public ks::Reference<simsense_device, simsense_device_retain, simsense_device_release> {
 public:
  explicit Device(const ks_device_desc& desc = ks_device_desc_init()) { check(simsense_device_create(&desc, &handle_)); }
  [[nodiscard]] ks_device_info info() const {
    ks_device_info info = ks_device_info_init();
    check(simsense_device_get_info(handle_, &info));
    return info;
  }
};
class Buffer : public ks::Reference<simsense_buffer, simsense_buffer_retain, simsense_buffer_release> {
 public:
  Buffer(simsense_device device, uint64_t size_bytes, uint32_t flags) {
    const ks_buffer_create create = ks_buffer_create_init(size_bytes, flags);
    check(simsense_buffer_create(device, &create, &handle_));
  }
  Buffer(simsense_device device, const ks_buffer_desc& shared) { check(simsense_buffer_import(device, &shared, &handle_)); }
  [[nodiscard]] ks_buffer_desc export_as(uint32_t memory) const {
    ks_buffer_desc desc = ks_buffer_desc_init();
    check(simsense_buffer_export(handle_, memory, &desc));
    return desc;
  }
  [[nodiscard]] void* map() const {
    void* address = nullptr;
    check(simsense_buffer_map(handle_, &address));
    return address;
  }
};
class Engine : public ks::Reference<simsense_engine, simsense_engine_retain, simsense_engine_release> {
 public:
  Engine(simsense_device device, const simsense_rig_desc& rig, const simsense_parameters& parameters = simsense_parameters_init()) {
    check(simsense_engine_create(device, &rig, &parameters, &handle_));
  }
};
}
#endif
