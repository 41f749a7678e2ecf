// SPDX-License-Identifier: Apache-2.0
// The driver's cache of compiled pipelines, kept in a file between processes. Thread rule: internally synchronised.
#pragma once

#include <atomic>
#include <filesystem>
#include <mutex>

#include "device/vulkan.h"

namespace ks {

/// Returns the cache file's name for this library (name and version), device and driver: other drivers' data would be refused.
std::string pipeline_file_name(const char* library, const VkPhysicalDeviceProperties& device);

class PipelineCache {
 public:
  /// Starts with the file's content if it is valid. An empty path: nothing is cached.
  PipelineCache(const VolkDeviceTable& vk, VkDevice device, std::filesystem::path file);
  ~PipelineCache();
  PipelineCache(const PipelineCache&) = delete;
  PipelineCache& operator=(const PipelineCache&) = delete;

  /// Returns the cache for one vkCreate...Pipelines call, and marks it as changed.
  [[nodiscard]] VkPipelineCache for_new_pipeline();
  /// Writes the file if pipelines were built since the last time and the driver's data grew. Returns false if writing failed.
  bool save();

 private:
  const VolkDeviceTable& vk_;
  VkDevice device_;
  std::filesystem::path file_;
  VkPipelineCache cache_ = VK_NULL_HANDLE;
  std::atomic<bool> used_{false};
  std::mutex mutex_;
  size_t kept_bytes_ = 0;  // of the file
};

}  // namespace ks
