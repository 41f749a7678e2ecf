// SPDX-License-Identifier: Apache-2.0
#include "device/instance.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <mutex>

#include "device/error.h"

namespace ks {
namespace {

constexpr const char* validation_layer = "VK_LAYER_KHRONOS_validation";

// The loader is opened once per process and never closed; its entry points are the same for every instance.
bool open_loader() {
  static const bool opened = volkInitialize() == VK_SUCCESS;
  return opened;
}

void load_instance_functions(VkInstance instance) {
  static std::once_flag once;
  std::call_once(once, [instance] { volkLoadInstanceOnly(instance); });
}

struct NoInstance {
  VkResult result;
};

/// Throws NoInstance.
VkInstance new_instance(const VkInstanceCreateInfo& info) {
  VkInstance instance = VK_NULL_HANDLE;
  const VkResult result = vkCreateInstance(&info, nullptr, &instance);
  if (result != VK_SUCCESS) throw NoInstance{result};
  return instance;
}

/// The first of the process that could be made; VK_NULL_HANDLE in a process forked since, which has none of the driver's threads.
VkInstance shared_instance(const VkInstanceCreateInfo& info) {
  struct Shared {
    VkInstance instance;
    pid_t process;
  };
  static const Shared first{new_instance(info), getpid()};
  return first.process == getpid() ? first.instance : VK_NULL_HANDLE;
}

std::string driver_variables() {
  std::string text;
  for (const char* name : {"VK_DRIVER_FILES", "VK_ICD_FILENAMES"})
    if (const char* value = std::getenv(name)) text += std::string("; ") + name + "=" + value;
  return text;
}

bool has_layer(const char* name) {
  uint32_t count = 0;
  if (vkEnumerateInstanceLayerProperties(&count, nullptr) < 0) return false;
  std::vector<VkLayerProperties> layers(count);
  if (vkEnumerateInstanceLayerProperties(&count, layers.data()) < 0) return false;
  return std::any_of(layers.begin(), layers.begin() + count, [&](const auto& l) { return std::strcmp(l.layerName, name) == 0; });
}

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT severity, VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
  std::string text = data->pMessage;
  std::replace(text.begin(), text.end(), '\n', ' ');
  const uint32_t level = severity >= VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT ? KS_LOG_ERROR : KS_LOG_WARNING;
  static_cast<LogSink*>(user)->write(level, text.c_str());
  return VK_FALSE;
}

}  // namespace

std::unique_ptr<Instance> Instance::create(std::shared_ptr<LogSink> log, bool validation, std::string* why_not) {
  if (!open_loader()) {
    *why_not = std::string("the Vulkan loader (libvulkan.so.1) was not found: ") + install_hint;
    return nullptr;
  }
  const uint32_t loader_version = volkGetInstanceVersion();
  if (loader_version < VK_API_VERSION_1_2) {
    *why_not = "the Vulkan loader is older than Vulkan 1.2: update the Debian package libvulkan1";
    return nullptr;
  }
  std::unique_ptr<Instance> self(new Instance);
  self->log_ = std::move(log);
  self->api_version_ = loader_version >= VK_API_VERSION_1_3 ? VK_API_VERSION_1_3 : VK_API_VERSION_1_2;

  if (validation && !has_layer(validation_layer)) {
    self->log_->write(KS_LOG_WARNING,
                      "validation was asked for, but VK_LAYER_KHRONOS_validation is not there: install vulkan-validationlayers");
    validation = false;
  }
  const char* extension = VK_EXT_DEBUG_UTILS_EXTENSION_NAME;
  VkApplicationInfo application{VK_STRUCTURE_TYPE_APPLICATION_INFO};
  application.pApplicationName = "activestereo";
  application.apiVersion = self->api_version_;
  VkInstanceCreateInfo info{VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO};
  info.pApplicationInfo = &application;
  info.enabledLayerCount = info.enabledExtensionCount = validation ? 1 : 0;
  info.ppEnabledLayerNames = &validation_layer;
  info.ppEnabledExtensionNames = &extension;
  try {
    if (!validation) self->instance_ = shared_instance(info);
    self->shared_ = self->instance_ != VK_NULL_HANDLE;
    if (!self->shared_) self->instance_ = new_instance(info);
  } catch (const NoInstance& none) {
    *why_not = std::string("the Vulkan loader found no working driver (vkCreateInstance: ") + result_name(none.result) +
               driver_variables() + "): " + install_hint;
    return nullptr;
  }
  load_instance_functions(self->instance_);
  if (validation && self->log_->wanted()) self->attach_messenger();
  return self;
}

void Instance::know_hosts(VkInstance instance) {
  if (!open_loader()) fail(KS_ERROR_NO_DEVICE, "the Vulkan loader (libvulkan.so.1) was not found: %s", install_hint);
  load_instance_functions(instance);
}

void Instance::attach_messenger() {
  // Asked of this instance and not kept by volk: another instance may be without the extension.
  const auto create =
      reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(vkGetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
  if (create == nullptr) return;
  VkDebugUtilsMessengerCreateInfoEXT info{VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT};
  info.messageSeverity = VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT;
  info.pfnUserCallback = on_message;
  info.pUserData = log_.get();
  check(create(instance_, &info, nullptr, &messenger_), "vkCreateDebugUtilsMessengerEXT");
}

Instance::~Instance() {
  if (instance_ == VK_NULL_HANDLE || shared_) return;
  if (messenger_ != VK_NULL_HANDLE) {
    const auto destroy =
        reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(vkGetInstanceProcAddr(instance_, "vkDestroyDebugUtilsMessengerEXT"));
    destroy(instance_, messenger_, nullptr);
  }
  vkDestroyInstance(instance_, nullptr);
}

std::vector<VkPhysicalDevice> Instance::physical_devices() const {
  uint32_t count = 0;
  check(vkEnumeratePhysicalDevices(instance_, &count, nullptr), "vkEnumeratePhysicalDevices");
  std::vector<VkPhysicalDevice> devices(count);
  if (count > 0) check(vkEnumeratePhysicalDevices(instance_, &count, devices.data()), "vkEnumeratePhysicalDevices");
  devices.resize(count);
  return devices;
}

}  // namespace ks
