/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SIMSENSE_API_TABLE_H
#define SIMSENSE_API_TABLE_H
#include <stddef.h>
#include "simsense/simsense.h"
#ifdef __cplusplus
extern "C" {
#endif
typedef struct simsense_api {
  uint64_t size_bytes;
  uint32_t (*version)(void);
  const char* (*last_error)(void);
  ks_status (*device_enumerate)(ks_device_info* infos, uint32_t* count);
  ks_status (*device_create)(const ks_device_desc* desc, simsense_device* out);
  ks_status (*device_get_info)(simsense_device device, ks_device_info* out);
  void (*device_retain)(simsense_device device);
  void (*device_release)(simsense_device device);
  ks_status (*device_copied_bytes)(simsense_device device, uint64_t* out);
  ks_status (*device_allocated_bytes)(simsense_device device, uint64_t* out);
  ks_status (*buffer_create)(simsense_device device, const ks_buffer_create* create, simsense_buffer* out);
  ks_status (*buffer_import)(simsense_device device, const ks_buffer_desc* desc, simsense_buffer* out);
  ks_status (*buffer_export)(simsense_buffer buffer, uint32_t memory, ks_buffer_desc* out);
  ks_status (*buffer_map)(simsense_buffer buffer, void** out);
  ks_status (*buffer_write)(simsense_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
  ks_status (*buffer_read)(simsense_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
  void (*buffer_retain)(simsense_buffer buffer);
  void (*buffer_release)(simsense_buffer buffer);
  ks_status (*signal_preset)(const char* name, simsense_signal* out);
  ks_status (*engine_create)(simsense_device device, const simsense_rig_desc* rig, const simsense_parameters* parameters, simsense_engine* out);
  ks_status (*engine_set_parameters)(simsense_engine engine, const simsense_parameters* parameters);
  ks_status (*engine_get_parameters)(simsense_engine engine, simsense_parameters* out);
  ks_status (*engine_set_signal)(simsense_engine engine, const simsense_signal* left, const simsense_signal* right);
  ks_status (*engine_get_signal)(simsense_engine engine, simsense_signal* left, simsense_signal* right);
  void (*engine_retain)(simsense_engine engine);
  void (*engine_release)(simsense_engine engine);
  ks_status (*engine_get_rectified)(simsense_engine engine, double* k, double* baseline_m, double* left_to_rectified);
  ks_status (*engine_compute)(simsense_engine engine, const simsense_compute_desc* desc);
  ks_status (*engine_submit)(simsense_engine engine, const simsense_compute_desc* desc, ks_sync* out);
  ks_status (*engine_wait)(simsense_engine engine, const ks_sync* sync);
  ks_status (*engine_export_timeline)(simsense_engine engine, ks_sync* out);
  ks_status (*engine_get_stage_times)(simsense_engine engine, ks_stage_time* times, uint32_t* count);
  ks_status (*struct_init)(uint32_t type, void* out, uint32_t size_bytes);
  ks_status (*engine_wait_for)(simsense_engine engine, const ks_sync* sync, uint64_t timeout_ns);
  ks_status (*engine_cancel)(simsense_engine engine);
} simsense_api;
#define SIMSENSE_API_HAS(api, entry) ((api)->size_bytes >= offsetof(simsense_api, entry) + sizeof((api)->entry))
SIMSENSE_API const simsense_api* simsense_get_api(void);
typedef const simsense_api* (*simsense_get_api_fn)(void);
#ifdef __cplusplus
}
#endif
#endif
