// SPDX-License-Identifier: Apache-2.0
// The one copy of volk (hidden), and what a VkResult means to us.
#define VOLK_IMPLEMENTATION
#include "device/vulkan.h"

#include "device/error.h"

namespace ks {
namespace {

ks_status status_of(VkResult result) {
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
      return KS_ERROR_OUT_OF_HOST_MEMORY;
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
    case VK_ERROR_TOO_MANY_OBJECTS:
      return KS_ERROR_OUT_OF_DEVICE_MEMORY;
    case VK_ERROR_DEVICE_LOST:
      return KS_ERROR_DEVICE_LOST;
    case VK_ERROR_INCOMPATIBLE_DRIVER:
      return KS_ERROR_NO_DEVICE;
    case VK_ERROR_LAYER_NOT_PRESENT:
    case VK_ERROR_EXTENSION_NOT_PRESENT:
    case VK_ERROR_FEATURE_NOT_PRESENT:
      return KS_ERROR_UNSUPPORTED;
    case VK_ERROR_INVALID_EXTERNAL_HANDLE:
    case VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS:
      return KS_ERROR_INVALID_ARGUMENT;
    default:
      return KS_ERROR_INTERNAL;
  }
}

}  // namespace

const char* result_name(VkResult result) {
#define KS_RESULT(name) \
  case name:            \
    return #name
  switch (result) {
    KS_RESULT(VK_SUCCESS);
    KS_RESULT(VK_NOT_READY);
    KS_RESULT(VK_TIMEOUT);
    KS_RESULT(VK_INCOMPLETE);
    KS_RESULT(VK_ERROR_OUT_OF_HOST_MEMORY);
    KS_RESULT(VK_ERROR_OUT_OF_DEVICE_MEMORY);
    KS_RESULT(VK_ERROR_INITIALIZATION_FAILED);
    KS_RESULT(VK_ERROR_DEVICE_LOST);
    KS_RESULT(VK_ERROR_MEMORY_MAP_FAILED);
    KS_RESULT(VK_ERROR_LAYER_NOT_PRESENT);
    KS_RESULT(VK_ERROR_EXTENSION_NOT_PRESENT);
    KS_RESULT(VK_ERROR_FEATURE_NOT_PRESENT);
    KS_RESULT(VK_ERROR_INCOMPATIBLE_DRIVER);
    KS_RESULT(VK_ERROR_TOO_MANY_OBJECTS);
    KS_RESULT(VK_ERROR_FRAGMENTATION);
    KS_RESULT(VK_ERROR_INVALID_EXTERNAL_HANDLE);
    KS_RESULT(VK_ERROR_INVALID_OPAQUE_CAPTURE_ADDRESS);
    KS_RESULT(VK_ERROR_INVALID_SHADER_NV);
    default:
      return "unknown VkResult";
  }
#undef KS_RESULT
}

void check(VkResult result, const char* what) {
  if (result < 0) fail(status_of(result), "%s: %s (%d)", what, result_name(result), static_cast<int>(result));
}

}  // namespace ks
