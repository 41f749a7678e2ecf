// SPDX-License-Identifier: Apache-2.0
// A Vulkan device (or none: the host device), its queue, its allocator and its worker threads. Shared by reference; everything made from it
// keeps it alive. Thread rule: internally synchronised.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "device/vulkan.h"
#include "ks/device.h"

namespace ks {

class HostMemory;
class Instance;
class LogSink;
class PipelineCache;
class Pipelines;
class SpareThreads;
class ThreadPool;
struct DeviceFeatures;
struct PhysicalFacts;

/// Lists every Vulkan device; a refused one carries its reasons. `why_none` says why the list is empty (no loader, no driver).
std::vector<ks_device_info> enumerate_devices(std::string* why_none);

class Device : public std::enable_shared_from_this<Device> {
 public:
  /// Opens the device. Throws KS_ERROR_NO_DEVICE with every device's reasons and what to install. `library`: name and version, under which
  /// pipelines are cached; nullptr caches none.
  static std::shared_ptr<Device> create(const ks_device_desc& desc, const char* library = nullptr);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  [[nodiscard]] const ks_device_info& info() const { return info_; }
  [[nodiscard]] bool has_vulkan() const { return device_ != VK_NULL_HANDLE; }
  /// True for CPU devices (lavapipe, host): device memory is host memory, and rays are faster in host code than in shaders.
  [[nodiscard]] bool is_cpu() const { return info_.kind == KS_DEVICE_KIND_CPU || info_.kind == KS_DEVICE_KIND_HOST; }

  /// Vulkan functions of this device: device->vk().vkCmdDispatch(...).
  [[nodiscard]] const VolkDeviceTable& vk() const { return table_; }
  [[nodiscard]] VkDevice handle() const { return device_; }
  [[nodiscard]] VkPhysicalDevice physical() const { return physical_; }
  [[nodiscard]] uint32_t queue_family() const { return queue_family_; }
  [[nodiscard]] const VkPhysicalDeviceLimits& limits() const { return limits_; }
  [[nodiscard]] uint32_t subgroup_size() const { return subgroup_size_; }
  [[nodiscard]] Pipelines& pipelines() const { return *pipelines_; }
  [[nodiscard]] PipelineCache& pipeline_cache() const { return *pipeline_cache_; }
  /// Whether a compute pipeline may require this subgroup size (VK_EXT_subgroup_size_control), or always has it.
  [[nodiscard]] bool can_require_subgroup_size(uint32_t size) const;
  /// Valid bits of a timestamp on our queue; 0 if the queue has none.
  [[nodiscard]] uint32_t timestamp_bits() const { return timestamp_bits_; }
  /// Alignment of imported host pointers, bytes; 0 if the device cannot import any.
  [[nodiscard]] uint64_t host_pointer_alignment() const { return host_pointer_alignment_; }
  [[nodiscard]] const VkPhysicalDeviceMemoryProperties& memory_properties() const { return memory_; }
  /// Bytes of the device's own memory that the host can map; 0 without such memory.
  [[nodiscard]] uint64_t mappable_bytes() const;
  /// The features that are enabled, among those that this project uses.
  [[nodiscard]] const VkPhysicalDeviceVulkan11Features& features11() const { return features11_; }
  [[nodiscard]] const VkPhysicalDeviceVulkan12Features& features12() const { return features12_; }
  /// Whether the host made the VkDevice (KS_SELECT_VULKAN); its memory and semaphores can then be shared directly.
  [[nodiscard]] bool is_hosts() const { return hosts_; }
  /// Lends the VkDevice and its queue to another library (KS_SELECT_VULKAN). That library's objects must end before this device.
  [[nodiscard]] ks_vulkan_device lend();
  /// Whether the extension is enabled.
  [[nodiscard]] bool has_extension(const char* name) const;
  /// Returns the index of a memory type in type_bits that has all `required` flags and the most `preferred` ones. Throws if there is none.
  [[nodiscard]] uint32_t memory_type(uint32_t type_bits, VkMemoryPropertyFlags required, VkMemoryPropertyFlags preferred) const;

  /// Submits one command buffer and waits for it on the host. Throws KS_ERROR_DEVICE_LOST now and in all later calls once the device is
  /// lost.
  void submit_and_wait(VkCommandBuffer commands);
  /// Submits one command buffer. It begins when the semaphore `wait` (or VK_NULL_HANDLE) has reached wait_value; `timeline` reaches `value`
  /// when it has run.
  void submit(VkCommandBuffer commands, VkSemaphore timeline, uint64_t value, VkSemaphore wait, uint64_t wait_value);
  /// Works as check(), and remembers that the device was lost.
  void check_alive(VkResult result, const char* what);

  [[nodiscard]] ThreadPool& workers() const { return *workers_; }
  /// Threads for work that must not wait for the caller's.
  [[nodiscard]] SpareThreads& spare_threads() const { return *spare_threads_; }
  /// The host's memory functions; nullptr if it lends none.
  [[nodiscard]] HostMemory* host_memory() const { return host_memory_.get(); }
  void log(uint32_t level, const char* format, ...) const __attribute__((format(printf, 3, 4)));

  void count_copy(uint64_t bytes) { copied_bytes_ += bytes; }
  [[nodiscard]] uint64_t copied_bytes() const { return copied_bytes_; }
  void count_allocated(int64_t bytes) { allocated_bytes_ += uint64_t(bytes); }
  [[nodiscard]] uint64_t allocated_bytes() const { return allocated_bytes_; }

 private:
  Device();
  void open_vulkan(const ks_device_desc& desc, const char* library);
  void run(VkCommandBuffer commands);
  /// Writes the pipeline cache. May call the log, so never call it under a mutex.
  void save_pipelines();
  void take_hosts(const ks_device_desc& desc, const char* library);
  void take_services(const ks_device_desc& desc);
  void take_facts(const PhysicalFacts& facts);
  void create_vk_device(const PhysicalFacts& facts);
  void prepare_vulkan(const ks_device_desc& desc, const char* library, const VkPhysicalDeviceProperties& properties);
  /// Submits to the queue, and holds the queue's lock only meanwhile.
  VkResult submit_to_queue(const VkSubmitInfo& submit, VkFence fence);
  ks_device_info info_{};
  std::shared_ptr<LogSink> log_;
  std::unique_ptr<Instance> instance_;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  VkDevice device_ = VK_NULL_HANDLE;
  std::unique_ptr<DeviceFeatures> created_with_;  // of our own VkDevice
  VkQueue queue_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
  uint32_t queue_family_ = 0, timestamp_bits_ = 0;
  uint32_t subgroup_size_ = 0, min_required_subgroup_size_ = 0, max_required_subgroup_size_ = 0;
  uint64_t host_pointer_alignment_ = 0;
  VkPhysicalDeviceLimits limits_{};
  VkPhysicalDeviceMemoryProperties memory_{};
  VkPhysicalDeviceVulkan11Features features11_{};
  VkPhysicalDeviceVulkan12Features features12_{};
  bool hosts_ = false;
  ks_lock_fn lock_queue_ = nullptr;  // the host's, of a queue that it uses too
  void* lock_user_ = nullptr;
  std::vector<std::string> extensions_;
  VolkDeviceTable table_{};
  std::unique_ptr<PipelineCache> pipeline_cache_;
  std::unique_ptr<Pipelines> pipelines_;
  std::mutex queue_mutex_;  // for a submission
  std::mutex fence_mutex_;  // from a submission with the fence to its end
  std::atomic<bool> lost_{false};
  std::atomic<uint64_t> copied_bytes_{0}, allocated_bytes_{0};
  std::unique_ptr<ThreadPool> workers_;
  std::unique_ptr<HostMemory> host_memory_;
  std::unique_ptr<SpareThreads> spare_threads_;
};

}  // namespace ks
