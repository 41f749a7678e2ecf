// SPDX-License-Identifier: Apache-2.0
#include "device/pipeline_cache.h"

#include <cstdio>
#include <string>

#include "device/cache_file.h"
#include "device/error.h"

namespace ks {

std::string pipeline_file_name(const char* library, const VkPhysicalDeviceProperties& device) {
  char text[64];
  std::snprintf(text, sizeof text, "-%04x-%04x-%08x-", device.vendorID, device.deviceID, device.driverVersion);
  std::string name = std::string(library) + text;
  for (const uint8_t byte : device.pipelineCacheUUID) {
    std::snprintf(text, sizeof text, "%02x", byte);
    name += text;
  }
  return name + ".pipelines";
}

PipelineCache::PipelineCache(const VolkDeviceTable& vk, VkDevice device, std::filesystem::path file)
    : vk_(vk), device_(device), file_(std::move(file)) {
  const auto kept = file_.empty() ? std::nullopt : read_cache_file(file_);
  VkPipelineCacheCreateInfo info{VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO};
  if (kept) {
    info.initialDataSize = kept_bytes_ = kept->size();
    info.pInitialData = kept->data();
  }
  VkResult result = vk_.vkCreatePipelineCache(device_, &info, nullptr, &cache_);
  if (result != VK_SUCCESS && kept) {  // a driver that refuses the data gets none
    info.initialDataSize = kept_bytes_ = 0;
    result = vk_.vkCreatePipelineCache(device_, &info, nullptr, &cache_);
  }
  check(result, "vkCreatePipelineCache");
}

PipelineCache::~PipelineCache() {
  save();
  vk_.vkDestroyPipelineCache(device_, cache_, nullptr);
}

VkPipelineCache PipelineCache::for_new_pipeline() {
  used_ = true;
  return cache_;
}

bool PipelineCache::save() {
  if (file_.empty() || !used_.exchange(false)) return true;
  std::lock_guard lock(mutex_);
  size_t size = 0;
  if (vk_.vkGetPipelineCacheData(device_, cache_, &size, nullptr) != VK_SUCCESS || size == 0 || size == kept_bytes_) return true;
  std::vector<std::byte> bytes(size);
  const VkResult result = vk_.vkGetPipelineCacheData(device_, cache_, &size, bytes.data());
  if (result != VK_SUCCESS) return true;  // another thread added to it: its save comes
  bytes.resize(size);
  kept_bytes_ = size;
  return write_cache_file(file_, bytes);
}

}  // namespace ks
