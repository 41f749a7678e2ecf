// SPDX-License-Identifier: Apache-2.0
/* simsense for C++17: owners of its handles, and errors as exceptions. Structs, constants and all other functions are those of simsense.h:
 *
 *   simsense::Device device;  simsense::Engine engine(device, rig);  simsense::check(simsense_engine_compute(engine, &desc));
 *
 * Every constructor throws ks::Error. Copies share the object; the threading rules of simsense.h hold. */
#ifndef SIMSENSE_SIMSENSE_HPP
#define SIMSENSE_SIMSENSE_HPP

#include "ks/handle.hpp"
#include "simsense/simsense.h"

namespace simsense {

/* Throws what a call to simsense failed with; benign statuses are returned. */
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
  /* flags: KS_BUFFER_*. */
  Buffer(simsense_device device, uint64_t size_bytes, uint32_t flags) {
    const ks_buffer_create_desc create = ks_buffer_create_desc_init(size_bytes, flags);
    check(simsense_buffer_create(device, &create, &handle_));
  }
  /* Imports what another library or device exported. */
  Buffer(simsense_device device, const ks_buffer_desc& shared) { check(simsense_buffer_import(device, &shared, &handle_)); }
  /* memory: KS_MEMORY_*. A file descriptor in it is the caller's to close. */
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

} /* namespace simsense */

#endif
