// SPDX-License-Identifier: Apache-2.0
// A VkInstance. All that ask for no validation share one, which stays, as the loader does: drivers go with the last instance, and NVIDIA's
// fails when it is loaded again some thirty times in a process. A device with validation has its own, for its messages. Thread rule:
// immutable after construction.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "device/log_sink.h"
#include "device/vulkan.h"

namespace ks {

class Instance {
 public:
  /// Makes an instance; nullptr without a loader, a driver or Vulkan 1.2. why_not then says which, and what to install.
  static std::unique_ptr<Instance> create(std::shared_ptr<LogSink> log, bool validation, std::string* why_not);
  /// Loads the loader's functions for an instance that the host made. Throws KS_ERROR_NO_DEVICE without a loader.
  static void know_hosts(VkInstance instance);
  ~Instance();
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;

  [[nodiscard]] std::vector<VkPhysicalDevice> physical_devices() const;
  [[nodiscard]] VkInstance handle() const { return instance_; }
  /// The Vulkan version that the application asked for. A device works at this or its own version, whichever is lower.
  [[nodiscard]] uint32_t api_version() const { return api_version_; }

 private:
  Instance() = default;
  void attach_messenger();
  std::shared_ptr<LogSink> log_;
  VkInstance instance_ = VK_NULL_HANDLE;
  bool shared_ = false;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  uint32_t api_version_ = 0;
};

/// The advice that ends every "no device" text.
inline constexpr const char* install_hint =
    "install the Debian packages libvulkan1 and mesa-vulkan-drivers (lavapipe, a CPU device), or your GPU's own Vulkan driver";

}  // namespace ks
