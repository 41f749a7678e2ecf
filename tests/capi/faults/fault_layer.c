/* SPDX-License-Identifier: Apache-2.0 */
#include "fault_layer.h"

#include <stdatomic.h>
#include <string.h>
#include <vulkan/vk_layer.h>
#include <vulkan/vulkan.h>

#define EXPORT __attribute__((visibility("default")))

static atomic_int countdown[FAULT_COUNT] = {-1, -1, -1};
static atomic_int fired[FAULT_COUNT];
static atomic_int devices;

EXPORT void fault_arm(fault what, int after) { atomic_store(&countdown[what], after); }
EXPORT int fault_fired(fault what) { return atomic_load(&fired[what]); }
EXPORT int fault_devices(void) { return atomic_load(&devices); }

static int fails(fault what) {
  int left = atomic_load(&countdown[what]);
  while (left >= 0 && !atomic_compare_exchange_weak(&countdown[what], &left, left - 1)) {
  }
  if (left != 0) return 0;
  atomic_fetch_add(&fired[what], 1);
  return 1;
}

/* The next functions down the chain. One driver serves the tests, so one set is enough. */
static PFN_vkGetInstanceProcAddr next_instance_function;
static PFN_vkGetDeviceProcAddr next_device_function;
static PFN_vkDestroyDevice next_destroy_device;
static PFN_vkAllocateMemory next_allocate;
static PFN_vkQueueSubmit next_submit;
static PFN_vkCreateComputePipelines next_pipelines;

static VKAPI_ATTR VkResult VKAPI_CALL allocate(VkDevice device, const VkMemoryAllocateInfo* info, const VkAllocationCallbacks* callbacks,
                                               VkDeviceMemory* out) {
  return fails(FAULT_ALLOCATE) ? VK_ERROR_OUT_OF_DEVICE_MEMORY : next_allocate(device, info, callbacks, out);
}

static VKAPI_ATTR VkResult VKAPI_CALL submit(VkQueue queue, uint32_t count, const VkSubmitInfo* infos, VkFence fence) {
  return fails(FAULT_SUBMIT) ? VK_ERROR_DEVICE_LOST : next_submit(queue, count, infos, fence);
}

static VKAPI_ATTR VkResult VKAPI_CALL pipelines(VkDevice device, VkPipelineCache cache, uint32_t count,
                                                const VkComputePipelineCreateInfo* infos, const VkAllocationCallbacks* callbacks,
                                                VkPipeline* out) {
  if (!fails(FAULT_PIPELINE)) return next_pipelines(device, cache, count, infos, callbacks, out);
  memset(out, 0, count * sizeof *out);
  return VK_ERROR_OUT_OF_HOST_MEMORY;
}

/* The loader's note in a chain of structs that says what comes after this layer. */
#define LINK_OF(type, stype, first)                                                                            \
  type* link = (type*)(first);                                                                                 \
  while (link && !(link->sType == (stype) && link->function == VK_LAYER_LINK_INFO)) link = (type*)link->pNext; \
  if (!link) return VK_ERROR_INITIALIZATION_FAILED

static VKAPI_ATTR VkResult VKAPI_CALL create_instance(const VkInstanceCreateInfo* info, const VkAllocationCallbacks* callbacks,
                                                      VkInstance* out) {
  LINK_OF(VkLayerInstanceCreateInfo, VK_STRUCTURE_TYPE_LOADER_INSTANCE_CREATE_INFO, info->pNext);
  next_instance_function = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  return ((PFN_vkCreateInstance)next_instance_function(VK_NULL_HANDLE, "vkCreateInstance"))(info, callbacks, out);
}

static VKAPI_ATTR VkResult VKAPI_CALL create_device(VkPhysicalDevice physical, const VkDeviceCreateInfo* info,
                                                    const VkAllocationCallbacks* callbacks, VkDevice* out) {
  LINK_OF(VkLayerDeviceCreateInfo, VK_STRUCTURE_TYPE_LOADER_DEVICE_CREATE_INFO, info->pNext);
  next_device_function = link->u.pLayerInfo->pfnNextGetDeviceProcAddr;
  const PFN_vkGetInstanceProcAddr instance_function = link->u.pLayerInfo->pfnNextGetInstanceProcAddr;
  link->u.pLayerInfo = link->u.pLayerInfo->pNext;
  const PFN_vkCreateDevice create = (PFN_vkCreateDevice)instance_function(VK_NULL_HANDLE, "vkCreateDevice");
  const VkResult result = create(physical, info, callbacks, out);
  if (result != VK_SUCCESS) return result;
  atomic_fetch_add(&devices, 1);
  next_destroy_device = (PFN_vkDestroyDevice)next_device_function(*out, "vkDestroyDevice");
  next_allocate = (PFN_vkAllocateMemory)next_device_function(*out, "vkAllocateMemory");
  next_submit = (PFN_vkQueueSubmit)next_device_function(*out, "vkQueueSubmit");
  next_pipelines = (PFN_vkCreateComputePipelines)next_device_function(*out, "vkCreateComputePipelines");
  return VK_SUCCESS;
}

static VKAPI_ATTR void VKAPI_CALL destroy_device(VkDevice device, const VkAllocationCallbacks* callbacks) {
  next_destroy_device(device, callbacks);
  if (device != VK_NULL_HANDLE) atomic_fetch_sub(&devices, 1);
}

static PFN_vkVoidFunction own_device_function(const char* name) {
  if (!strcmp(name, "vkDestroyDevice")) return (PFN_vkVoidFunction)destroy_device;
  if (!strcmp(name, "vkAllocateMemory")) return (PFN_vkVoidFunction)allocate;
  if (!strcmp(name, "vkQueueSubmit")) return (PFN_vkVoidFunction)submit;
  if (!strcmp(name, "vkCreateComputePipelines")) return (PFN_vkVoidFunction)pipelines;
  return NULL;
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_function(VkDevice device, const char* name) {
  const PFN_vkVoidFunction own = own_device_function(name);
  return own ? own : next_device_function(device, name);
}

static VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_function(VkInstance instance, const char* name) {
  if (!strcmp(name, "vkCreateInstance")) return (PFN_vkVoidFunction)create_instance;
  if (!strcmp(name, "vkCreateDevice")) return (PFN_vkVoidFunction)create_device;
  if (!strcmp(name, "vkGetDeviceProcAddr")) return (PFN_vkVoidFunction)device_function;
  const PFN_vkVoidFunction own = own_device_function(name);
  if (own) return own;
  return next_instance_function ? next_instance_function(instance, name) : NULL;
}

EXPORT VkResult vkNegotiateLoaderLayerInterfaceVersion(VkNegotiateLayerInterface* version) {
  if (version->loaderLayerInterfaceVersion < 2) return VK_ERROR_INITIALIZATION_FAILED;
  version->loaderLayerInterfaceVersion = 2;
  version->pfnGetInstanceProcAddr = instance_function;
  version->pfnGetDeviceProcAddr = device_function;
  version->pfnGetPhysicalDeviceProcAddr = NULL;
  return VK_SUCCESS;
}
