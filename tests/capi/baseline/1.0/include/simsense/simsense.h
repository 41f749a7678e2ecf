/* SPDX-License-Identifier: Apache-2.0 */
#ifndef SIMSENSE_SIMSENSE_H
#define SIMSENSE_SIMSENSE_H
#include <stdint.h>
#include <string.h>
#include "ks/buffer.h"
#include "ks/device.h"
#include "ks/header.h"
#include "ks/image.h"
#include "ks/log.h"
#include "ks/status.h"
#include "ks/sync.h"
#include "simsense/compute.h"
#include "simsense/parameters.h"
#include "simsense/rig.h"
#include "simsense/signal.h"
#define SIMSENSE_VERSION_MAJOR 0
#define SIMSENSE_VERSION_MINOR 2
#define SIMSENSE_VERSION_PATCH 0
#if defined(__GNUC__)
#define SIMSENSE_API __attribute__((visibility("default")))
#else
#define SIMSENSE_API
#endif
#ifdef __cplusplus
extern "C" {
#endif
typedef struct simsense_device_t* simsense_device;
typedef struct simsense_engine_t* simsense_engine;
SIMSENSE_API uint32_t simsense_version(void);
SIMSENSE_API const char* simsense_last_error(void);
SIMSENSE_API ks_status simsense_struct_init(uint32_t type, void* out, uint32_t size_bytes);
SIMSENSE_API ks_status simsense_device_enumerate(ks_device_info* infos, uint32_t* count);
SIMSENSE_API ks_status simsense_device_create(const ks_device_desc* desc, simsense_device* out);
SIMSENSE_API ks_status simsense_device_get_info(simsense_device device, ks_device_info* out);
SIMSENSE_API void simsense_device_retain(simsense_device device);
SIMSENSE_API void simsense_device_release(simsense_device device);
SIMSENSE_API ks_status simsense_device_copied_bytes(simsense_device device, uint64_t* out);
SIMSENSE_API ks_status simsense_device_allocated_bytes(simsense_device device, uint64_t* out);
SIMSENSE_API ks_status simsense_buffer_create(simsense_device device, const ks_buffer_create* create, simsense_buffer* out);
SIMSENSE_API ks_status simsense_buffer_import(simsense_device device, const ks_buffer_desc* desc, simsense_buffer* out);
SIMSENSE_API ks_status simsense_buffer_export(simsense_buffer buffer, uint32_t memory, ks_buffer_desc* out);
SIMSENSE_API ks_status simsense_buffer_map(simsense_buffer buffer, void** out);
SIMSENSE_API ks_status simsense_buffer_write(simsense_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
SIMSENSE_API ks_status simsense_buffer_read(simsense_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
SIMSENSE_API void simsense_buffer_retain(simsense_buffer buffer);
SIMSENSE_API void simsense_buffer_release(simsense_buffer buffer);
SIMSENSE_API ks_status simsense_signal_preset(const char* name, simsense_signal* out);
SIMSENSE_API ks_status simsense_engine_create(simsense_device device, const simsense_rig_desc* rig, const simsense_parameters* parameters, simsense_engine* out);
SIMSENSE_API ks_status simsense_engine_set_parameters(simsense_engine engine, const simsense_parameters* parameters);
SIMSENSE_API ks_status simsense_engine_get_parameters(simsense_engine engine, simsense_parameters* out);
SIMSENSE_API ks_status simsense_engine_set_signal(simsense_engine engine, const simsense_signal* left, const simsense_signal* right);
SIMSENSE_API ks_status simsense_engine_get_signal(simsense_engine engine, simsense_signal* left, simsense_signal* right);
SIMSENSE_API void simsense_engine_retain(simsense_engine engine);
SIMSENSE_API void simsense_engine_release(simsense_engine engine);
SIMSENSE_API ks_status simsense_engine_get_rectified(simsense_engine engine, double* k, double* baseline_m, double* left_to_rectified);
SIMSENSE_API ks_status simsense_engine_compute(simsense_engine engine, const simsense_compute_desc* desc);
SIMSENSE_API ks_status simsense_engine_submit(simsense_engine engine, const simsense_compute_desc* desc, ks_sync* out);
SIMSENSE_API ks_status simsense_engine_wait(simsense_engine engine, const ks_sync* sync);
SIMSENSE_API ks_status simsense_engine_wait_for(simsense_engine engine, const ks_sync* sync, uint64_t timeout_ns);
SIMSENSE_API ks_status simsense_engine_cancel(simsense_engine engine);
SIMSENSE_API ks_status simsense_engine_export_timeline(simsense_engine engine, ks_sync* out);
SIMSENSE_API ks_status simsense_engine_get_stage_times(simsense_engine engine, ks_stage_time* times, uint32_t* count);
#ifdef __cplusplus
}
#endif
#endif
