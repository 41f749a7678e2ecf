// SPDX-License-Identifier: Apache-2.0
/* A Vulkan layer in which a call fails as if a device had run out of memory or was lost. A test opens the layer's library and arms it. */
#ifndef FAULT_LAYER_H
#define FAULT_LAYER_H

#define FAULT_LAYER_NAME "VK_LAYER_ACTIVESTEREO_faults"

typedef enum fault {
  FAULT_ALLOCATE, /* vkAllocateMemory: VK_ERROR_OUT_OF_DEVICE_MEMORY */
  FAULT_SUBMIT,   /* vkQueueSubmit: VK_ERROR_DEVICE_LOST */
  FAULT_PIPELINE, /* vkCreateComputePipelines: VK_ERROR_OUT_OF_HOST_MEMORY */
  FAULT_COUNT
} fault;

/* The call after so many more fails, once; below 0: none does. */
typedef void (*fault_arm_fn)(fault what, int after);
/* How often such a call has failed since the library was loaded. */
typedef int (*fault_fired_fn)(fault what);
/* How many VkDevices there are. */
typedef int (*fault_devices_fn)(void);

#endif
