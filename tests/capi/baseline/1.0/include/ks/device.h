/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KS_DEVICE_H
#define KS_DEVICE_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "ks/log.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KS_SELECT_AUTO 0u
#define KS_SELECT_INDEX 1u
#define KS_SELECT_UUID 2u
#define KS_SELECT_HOST 3u
#define KS_SELECT_CPU 4u
#define KS_SELECT_VULKAN 5u
#define KS_DEVICE_KIND_HOST 0u
#define KS_DEVICE_KIND_CPU 1u
#define KS_DEVICE_KIND_INTEGRATED_GPU 2u
#define KS_DEVICE_KIND_DISCRETE_GPU 3u
#define KS_DEVICE_KIND_VIRTUAL_GPU 4u
#define KS_DEVICE_KIND_OTHER 5u
#define KS_CAP_EXPORT_OPAQUE_FD 0x01u
#define KS_CAP_IMPORT_OPAQUE_FD 0x02u
#define KS_CAP_IMPORT_HOST_POINTER 0x04u
#define KS_CAP_EXPORT_HOST_POINTER 0x08u
#define KS_CAP_RAY_TRACING_PIPELINE 0x10u
#define KS_CAP_TIMELINE_FD 0x20u
#define KS_CAP_EXPORT_DMA_BUF 0x40u
#define KS_CAP_IMPORT_DMA_BUF 0x80u
typedef void (*ks_lock_fn)(void* user, uint32_t locked);
typedef void (*ks_task_fn)(void* work, uint64_t index);
typedef void (*ks_parallel_for_fn)(void* user, uint64_t count, ks_task_fn task, void* work);
typedef void* (*ks_allocate_fn)(void* user, uint64_t size_bytes, uint64_t alignment_bytes);
typedef void (*ks_deallocate_fn)(void* user, void* memory, uint64_t size_bytes, uint64_t alignment_bytes);
#define KS_TYPE_VULKAN_DEVICE 0x0au
#define KS_TYPE_HOST_SERVICES 0x0bu
#define KS_TYPE_DEVICE_DESC 0x01u
#define KS_TYPE_DEVICE_INFO 0x02u
typedef struct ks_vulkan_device {
  ks_header header;
  void* instance;
  void* physical_device;
  void* device;
  void* queue;
  const void* create_info;
  uint32_t queue_family_index;
  uint32_t api_version;
  ks_lock_fn lock_queue;
  void* lock_user;
} ks_vulkan_device;
static inline ks_vulkan_device ks_vulkan_device_init(void) {
  ks_vulkan_device s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_VULKAN_DEVICE, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct ks_host_services {
  ks_header header;
  ks_parallel_for_fn parallel_for;
  void* parallel_user;
  ks_allocate_fn allocate;
  ks_deallocate_fn deallocate;
  void* memory_user;
} ks_host_services;
static inline ks_host_services ks_host_services_init(void) {
  ks_host_services s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_HOST_SERVICES, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct ks_device_desc {
  ks_header header;
  uint32_t select;
  uint32_t index;
  uint8_t uuid[16];
  uint32_t worker_count;
  uint32_t validation;
  ks_log_fn log;
  void* log_user;
  const char* cache_directory;
  const ks_vulkan_device* vulkan;
  const ks_host_services* host;
} ks_device_desc;
static inline ks_device_desc ks_device_desc_init(void) {
  ks_device_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_DEVICE_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct ks_device_info {
  ks_header header;
  char name[256];
  char driver[256];
  char refused[512];
  uint8_t device_uuid[16];
  uint8_t driver_uuid[16];
  uint32_t index;
  uint32_t kind;
  uint32_t api_version;
  uint32_t usable;
  uint64_t capabilities;
  uint64_t memory_bytes;
} ks_device_info;
static inline ks_device_info ks_device_info_init(void) {
  ks_device_info s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KS_TYPE_DEVICE_INFO, KS_CAST(uint32_t, sizeof s));
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
