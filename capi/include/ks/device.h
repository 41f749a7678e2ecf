/* Which device a library runs on, and what a device can do. */
#ifndef KS_DEVICE_H
#define KS_DEVICE_H

#include <stdint.h>
#include <string.h>

#include "ks/header.h"
#include "ks/log.h"

/* How ks_device_desc picks a device. AUTO: the best usable Vulkan device (discrete GPU, integrated, virtual, CPU; then enumeration order).
 * HOST: no Vulkan at all, the CPU back end of simsense (kuafu needs Vulkan and refuses HOST). */
#define KS_SELECT_AUTO 0u
#define KS_SELECT_INDEX 1u
#define KS_SELECT_UUID 2u
#define KS_SELECT_HOST 3u
#define KS_SELECT_CPU 4u /* the first Vulkan device of type CPU (lavapipe) */

typedef struct ks_device_desc {
  ks_header header;
  uint32_t select;       /* KS_SELECT_* */
  uint32_t index;        /* with KS_SELECT_INDEX: position in ..._device_enumerate */
  uint8_t uuid[16];      /* with KS_SELECT_UUID: ks_device_info.device_uuid */
  uint32_t worker_count; /* host threads; 0 = one per core. Results never depend on it. */
  uint32_t validation;   /* nonzero: enable VK_LAYER_KHRONOS_validation where installed; its messages go to `log` */
  ks_log_fn log;         /* may be NULL */
  void* log_user;
  /* Folder for compiled pipelines, so that later processes start at once; made when needed, one small file per library, version, device and
   * driver. NULL = $XDG_CACHE_HOME/activestereo, else ~/.cache/activestereo; "" = keep none. A folder that cannot be written does no harm.
   * Drivers may keep more of their own elsewhere (Mesa: MESA_SHADER_CACHE_DIR). */
  const char* cache_directory;
} ks_device_desc;

static inline ks_device_desc ks_device_desc_init(void) {
  ks_device_desc d;
  memset(&d, 0, sizeof d);
  d.header = ks_header_make(KS_TYPE_DEVICE_DESC, (uint32_t)sizeof d);
  return d;
}

#define KS_DEVICE_KIND_HOST 0u
#define KS_DEVICE_KIND_CPU 1u
#define KS_DEVICE_KIND_INTEGRATED_GPU 2u
#define KS_DEVICE_KIND_DISCRETE_GPU 3u
#define KS_DEVICE_KIND_VIRTUAL_GPU 4u
#define KS_DEVICE_KIND_OTHER 5u

/* Bits of ks_device_info.capabilities. */
#define KS_CAP_EXPORT_OPAQUE_FD 0x01u
#define KS_CAP_IMPORT_OPAQUE_FD 0x02u
#define KS_CAP_IMPORT_HOST_POINTER 0x04u
#define KS_CAP_EXPORT_HOST_POINTER 0x08u
#define KS_CAP_RAY_TRACING_PIPELINE 0x10u
#define KS_CAP_TIMELINE_FD 0x20u

typedef struct ks_device_info {
  ks_header header;
  char name[256];
  char driver[256];       /* driver name and version, as the driver tells it */
  char refused[512];      /* empty when usable; else every reason, each with what is missing */
  uint8_t device_uuid[16];
  uint8_t driver_uuid[16];
  uint32_t index;
  uint32_t kind;          /* KS_DEVICE_KIND_* */
  uint32_t api_version;   /* Vulkan's packing */
  uint32_t usable;        /* 0 or 1 */
  uint64_t capabilities;  /* KS_CAP_* */
  uint64_t memory_bytes;  /* largest device-local heap */
} ks_device_info;

static inline ks_device_info ks_device_info_init(void) {
  ks_device_info i;
  memset(&i, 0, sizeof i);
  i.header = ks_header_make(KS_TYPE_DEVICE_INFO, (uint32_t)sizeof i);
  return i;
}

#endif
