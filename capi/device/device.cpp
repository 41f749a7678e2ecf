// SPDX-License-Identifier: Apache-2.0
#include "device/device.h"

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstring>

#include "device/cache_file.h"
#include "device/error.h"
#include "device/host_memory.h"
#include "device/instance.h"
#include "device/log_sink.h"
#include "device/physical.h"
#include "device/pipeline_cache.h"
#include "device/pipelines.h"
#include "device/spare_threads.h"
#include "device/struct_read.h"
#include "device/struct_table.h"
#include "device/thread_pool.h"

namespace ks {
namespace {

constexpr uint32_t max_worker_count = 1024;

std::vector<PhysicalFacts> all_facts(const Instance& instance) {
  std::vector<PhysicalFacts> facts;
  for (VkPhysicalDevice device : instance.physical_devices()) facts.push_back(query_facts(device, instance.api_version()));
  return facts;
}

std::vector<ks_device_info> describe_all(const std::vector<PhysicalFacts>& facts) {
  std::vector<ks_device_info> infos;
  for (size_t i = 0; i < facts.size(); ++i) infos.push_back(describe(facts[i], static_cast<uint32_t>(i)));
  return infos;
}

std::string no_driver_text() { return std::string("the Vulkan loader found no device: ") + install_hint; }

ks_device_info host_info() {
  ks_device_info info = ks_device_info_init();
  std::snprintf(info.name, sizeof info.name, "host CPU (no Vulkan)");
  info.kind = KS_DEVICE_KIND_HOST;
  info.usable = 1;
  info.capabilities = KS_CAP_IMPORT_HOST_POINTER | KS_CAP_EXPORT_HOST_POINTER;
  info.memory_bytes = physical_memory_bytes();
  return info;
}

// Extensions that are used where they exist; none is required.
std::vector<const char*> wanted_extensions(const PhysicalFacts& facts) {
  std::vector<const char*> wanted;
  for (const char* name :
       {VK_KHR_EXTERNAL_MEMORY_FD_EXTENSION_NAME, VK_EXT_EXTERNAL_MEMORY_DMA_BUF_EXTENSION_NAME, VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME,
        VK_KHR_EXTERNAL_SEMAPHORE_FD_EXTENSION_NAME, VK_EXT_SUBGROUP_SIZE_CONTROL_EXTENSION_NAME})
    if (facts.has_extension(name)) wanted.push_back(name);
  if (facts.ray_tracing_pipeline) wanted.insert(wanted.end(), std::begin(ray_tracing_extensions), std::end(ray_tracing_extensions));
  return wanted;
}

}  // namespace

/// The features and extensions that a VkDevice of ours is made with.
struct DeviceFeatures {
  explicit DeviceFeatures(const PhysicalFacts& facts) : extensions(wanted_extensions(facts)) {
    control.subgroupSizeControl = VK_TRUE;
    if (facts.subgroup_size_control) f12.pNext = &control;
    f12.bufferDeviceAddress = f12.scalarBlockLayout = VK_TRUE;
    f12.timelineSemaphore = facts.features12.timelineSemaphore;
    f12.shaderInt8 = facts.features12.shaderInt8;
    f12.shaderFloat16 = facts.features12.shaderFloat16;
    f12.storageBuffer8BitAccess = facts.features12.storageBuffer8BitAccess;
    f12.uniformAndStorageBuffer8BitAccess = facts.features12.uniformAndStorageBuffer8BitAccess;
    f12.shaderSubgroupExtendedTypes = facts.features12.shaderSubgroupExtendedTypes;
    f11.storageBuffer16BitAccess = facts.features11.storageBuffer16BitAccess;
    f11.uniformAndStorageBuffer16BitAccess = facts.features11.uniformAndStorageBuffer16BitAccess;
    pipeline.rayTracingPipeline = pipeline.rayTracingPipelineTraceRaysIndirect = VK_TRUE;
    structure.accelerationStructure = VK_TRUE;
    if (facts.ray_tracing_pipeline) features.pNext = &structure;
    features.features.shaderInt64 = facts.features.shaderInt64;
    features.features.shaderInt16 = facts.features.shaderInt16;
    queue.queueFamilyIndex = facts.queue_family;
    queue.queueCount = 1;
    queue.pQueuePriorities = &priority;
    info.queueCreateInfoCount = 1;
    info.pQueueCreateInfos = &queue;
    info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
    info.ppEnabledExtensionNames = extensions.data();
  }
  DeviceFeatures(const DeviceFeatures&) = delete;
  DeviceFeatures& operator=(const DeviceFeatures&) = delete;

  std::vector<const char*> extensions;
  VkPhysicalDeviceSubgroupSizeControlFeatures control{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_SUBGROUP_SIZE_CONTROL_FEATURES};
  VkPhysicalDeviceVulkan12Features f12{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES};
  VkPhysicalDeviceVulkan11Features f11{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_1_FEATURES, &f12};
  VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR, &f11};
  VkPhysicalDeviceAccelerationStructureFeaturesKHR structure{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
                                                             &pipeline};
  VkPhysicalDeviceFeatures2 features{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, &f11};
  const float priority = 1.0f;
  VkDeviceQueueCreateInfo queue{VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO};
  VkDeviceCreateInfo info{VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO, &features};
};

std::vector<ks_device_info> enumerate_devices(std::string* why_none) {
  const auto instance = Instance::create(std::make_shared<LogSink>(nullptr, nullptr), false, why_none);
  if (!instance) return {};
  auto infos = describe_all(all_facts(*instance));
  if (infos.empty()) *why_none = no_driver_text();
  return infos;
}

Device::Device() = default;

std::shared_ptr<Device> Device::create(const ks_device_desc& desc, const char* library) {
  if (desc.worker_count > max_worker_count)
    fail(KS_ERROR_INVALID_ARGUMENT, "device desc: worker_count is %u, at most %u are allowed", desc.worker_count, max_worker_count);
  std::shared_ptr<Device> self(new Device);
  self->log_ = std::make_shared<LogSink>(desc.log, desc.log_user);
  if (desc.select == KS_SELECT_HOST)
    self->info_ = host_info();
  else if (desc.select == KS_SELECT_VULKAN)
    self->take_hosts(desc, library);
  else
    self->open_vulkan(desc, library);
  self->take_services(desc);
  self->log(KS_LOG_INFO, "device %s, driver %s, %u host threads", self->info_.name, self->info_.driver, self->workers_->size());
  return self;
}

void Device::open_vulkan(const ks_device_desc& desc, const char* library) {
  std::string why_none;
  instance_ = Instance::create(log_, desc.validation != 0, &why_none);
  std::vector<PhysicalFacts> facts;
  if (instance_) {
    facts = all_facts(*instance_);
    why_none = no_driver_text();
  }
  const std::vector<ks_device_info> infos = describe_all(facts);
  const size_t chosen = select_device(infos, desc, why_none);
  info_ = infos[chosen];
  take_facts(facts[chosen]);
  create_vk_device(facts[chosen]);
  vk().vkGetDeviceQueue(device_, queue_family_, 0, &queue_);
  prepare_vulkan(desc, library, facts[chosen].properties);
}

void Device::take_hosts(const ks_device_desc& desc, const char* library) {
  const auto host = read_struct(desc.vulkan, KS_TYPE_VULKAN_DEVICE, "device desc: vulkan");
  Instance::know_hosts(static_cast<VkInstance>(host.instance));
  const PhysicalFacts facts = hosts_facts(host);
  info_ = describe(facts, 0);
  if (!info_.usable)
    fail(KS_ERROR_UNSUPPORTED, "the host's VkDevice on %s cannot be used: %s (as far as its VkDeviceCreateInfo enables it)", info_.name,
         info_.refused);
  take_facts(facts);
  hosts_ = true;
  device_ = static_cast<VkDevice>(host.device);
  queue_ = static_cast<VkQueue>(host.queue);
  lock_queue_ = host.lock_queue;
  lock_user_ = host.lock_user;
  extensions_ = facts.extensions;
  volkLoadDeviceTable(&table_, device_);
  prepare_vulkan(desc, library, facts.properties);
}

void Device::take_services(const ks_device_desc& desc) {
  ks_host_services host = ks_host_services_init();
  if (desc.host != nullptr) host = read_struct(desc.host, KS_TYPE_HOST_SERVICES, "device desc: host");
  if ((host.allocate == nullptr) != (host.deallocate == nullptr))
    fail(KS_ERROR_INVALID_ARGUMENT, "device desc: host has %s, but no %s: give both or neither",
         host.allocate != nullptr ? "allocate" : "deallocate", host.allocate != nullptr ? "deallocate" : "allocate");
  if (host.allocate != nullptr) host_memory_ = std::make_unique<HostMemory>(host.allocate, host.deallocate, host.memory_user);
  spare_threads_ = std::make_unique<SpareThreads>();
  workers_ = host.parallel_for == nullptr ? std::make_unique<ThreadPool>(desc.worker_count)
                                          : std::make_unique<ThreadPool>(desc.worker_count, host.parallel_for, host.parallel_user);
}

void Device::prepare_vulkan(const ks_device_desc& desc, const char* library, const VkPhysicalDeviceProperties& properties) {
  const VkFenceCreateInfo fence{VK_STRUCTURE_TYPE_FENCE_CREATE_INFO};
  check(vk().vkCreateFence(device_, &fence, nullptr, &fence_), "vkCreateFence");
  std::filesystem::path file = library == nullptr ? std::filesystem::path() : cache_folder(desc.cache_directory);
  if (!file.empty()) file /= pipeline_file_name(library, properties);
  pipeline_cache_ = std::make_unique<PipelineCache>(table_, device_, std::move(file));
  pipelines_ = std::make_unique<Pipelines>(*this);
}

void Device::take_facts(const PhysicalFacts& facts) {
  physical_ = facts.handle;
  queue_family_ = facts.queue_family;
  timestamp_bits_ = facts.timestamp_bits;
  subgroup_size_ = facts.subgroup_size;
  if (facts.subgroup_size_control) {
    min_required_subgroup_size_ = facts.min_subgroup_size;
    max_required_subgroup_size_ = facts.max_subgroup_size;
  }
  host_pointer_alignment_ = facts.host_pointer_alignment;
  limits_ = facts.properties.limits;
  memory_ = facts.memory;
  features11_ = facts.features11;
  features12_ = facts.features12;
}

void Device::create_vk_device(const PhysicalFacts& facts) {
  created_with_ = std::make_unique<DeviceFeatures>(facts);
  const VkDeviceCreateInfo& info = created_with_->info;
  check(vkCreateDevice(physical_, &info, nullptr, &device_), "vkCreateDevice");
  volkLoadDeviceTable(&table_, device_);
  extensions_.assign(created_with_->extensions.begin(), created_with_->extensions.end());
}

ks_vulkan_device Device::lend() {
  if (!has_vulkan()) fail(KS_ERROR_UNSUPPORTED, "%s has no VkDevice to lend", info_.name);
  if (hosts_)
    fail(KS_ERROR_INVALID_STATE, "the VkDevice on %s is the host's (KS_SELECT_VULKAN): give the host's ks_vulkan_device again", info_.name);
  ks_vulkan_device lent = ks_vulkan_device_init();
  lent.instance = instance_->handle();
  lent.physical_device = physical_;
  lent.device = device_;
  lent.queue = queue_;
  lent.create_info = &created_with_->info;
  lent.queue_family_index = queue_family_;
  lent.api_version = instance_->api_version();
  lent.lock_queue = [](void* user, uint32_t locked) {
    std::mutex& queue = static_cast<Device*>(user)->queue_mutex_;
    locked ? queue.lock() : queue.unlock();
  };
  lent.lock_user = this;
  return lent;
}

Device::~Device() {
  workers_.reset();
  if (device_ == VK_NULL_HANDLE) return;
  if (!hosts_) vk().vkDeviceWaitIdle(device_);  // the host's other queues are not ours to wait for; whoever submitted has waited
  pipelines_.reset();
  pipeline_cache_.reset();
  vk().vkDestroyFence(device_, fence_, nullptr);
  if (!hosts_) vk().vkDestroyDevice(device_, nullptr);
}

bool Device::has_extension(const char* name) const { return std::find(extensions_.begin(), extensions_.end(), name) != extensions_.end(); }

bool Device::can_require_subgroup_size(uint32_t size) const {
  const bool power_of_two = size != 0 && (size & (size - 1)) == 0;
  return power_of_two && size >= min_required_subgroup_size_ && size <= max_required_subgroup_size_;
}

uint32_t Device::memory_type(uint32_t type_bits, VkMemoryPropertyFlags required, VkMemoryPropertyFlags preferred) const {
  // These need features that are not enabled.
  constexpr VkMemoryPropertyFlags excluded =
      VK_MEMORY_PROPERTY_PROTECTED_BIT | VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD | VK_MEMORY_PROPERTY_DEVICE_UNCACHED_BIT_AMD;
  uint32_t best = UINT32_MAX;
  int best_count = -1;
  for (uint32_t i = 0; i < memory_.memoryTypeCount; ++i) {
    const VkMemoryPropertyFlags flags = memory_.memoryTypes[i].propertyFlags;
    if (!(type_bits >> i & 1u) || (flags & required) != required || (flags & excluded) != 0) continue;
    const int count = __builtin_popcount(flags & preferred);
    if (count > best_count) {
      best = i;
      best_count = count;
    }
  }
  if (best == UINT32_MAX)
    fail(KS_ERROR_UNSUPPORTED, "%s has no memory type with property flags 0x%x among type bits 0x%x", info_.name, required, type_bits);
  return best;
}

uint64_t Device::mappable_bytes() const {
  constexpr VkMemoryPropertyFlags wanted =
      VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT | VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  uint64_t bytes = 0;
  for (uint32_t i = 0; i < memory_.memoryTypeCount; ++i)
    if ((memory_.memoryTypes[i].propertyFlags & wanted) == wanted)
      bytes = std::max<uint64_t>(bytes, memory_.memoryHeaps[memory_.memoryTypes[i].heapIndex].size);
  return bytes;
}

void Device::submit_and_wait(VkCommandBuffer commands) {
  run(commands);
  save_pipelines();  // drivers may compile as late as at the first run; and a process that ends without releasing its device keeps them too
}

void Device::run(VkCommandBuffer commands) {
  const std::lock_guard lock(fence_mutex_);
  if (lost_) fail(KS_ERROR_DEVICE_LOST, "%s was lost in an earlier call: create a new device", info_.name);
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO};
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands;
  VkResult result = submit_to_queue(submit, fence_);
  if (result == VK_SUCCESS) result = vk().vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX);
  check_alive(result, "running commands on the device");
  check(vk().vkResetFences(device_, 1, &fence_), "vkResetFences");
}

void Device::save_pipelines() {
  if (!pipeline_cache_->save())
    log(KS_LOG_INFO, "compiled pipelines could not be written to the cache folder: the next process builds them again");
}

VkResult Device::submit_to_queue(const VkSubmitInfo& submit, VkFence fence) {
  const std::lock_guard lock(queue_mutex_);
  if (lock_queue_ != nullptr) lock_queue_(lock_user_, 1);
  const VkResult result = vk().vkQueueSubmit(queue_, 1, &submit, fence);
  if (lock_queue_ != nullptr) lock_queue_(lock_user_, 0);
  return result;
}

void Device::submit(VkCommandBuffer commands, VkSemaphore timeline, uint64_t value, VkSemaphore wait, uint64_t wait_value) {
  const VkPipelineStageFlags all = VK_PIPELINE_STAGE_ALL_COMMANDS_BIT;
  VkTimelineSemaphoreSubmitInfo signal{VK_STRUCTURE_TYPE_TIMELINE_SEMAPHORE_SUBMIT_INFO};
  signal.signalSemaphoreValueCount = 1;
  signal.pSignalSemaphoreValues = &value;
  VkSubmitInfo submit{VK_STRUCTURE_TYPE_SUBMIT_INFO, &signal};
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands;
  submit.signalSemaphoreCount = 1;
  submit.pSignalSemaphores = &timeline;
  if (wait != VK_NULL_HANDLE) {
    signal.waitSemaphoreValueCount = 1;
    signal.pWaitSemaphoreValues = &wait_value;
    submit.waitSemaphoreCount = 1;
    submit.pWaitSemaphores = &wait;
    submit.pWaitDstStageMask = &all;
  }
  if (lost_) fail(KS_ERROR_DEVICE_LOST, "%s was lost in an earlier call: create a new device", info_.name);
  check_alive(submit_to_queue(submit, VK_NULL_HANDLE), "vkQueueSubmit");
}

void Device::check_alive(VkResult result, const char* what) {
  if (result == VK_ERROR_DEVICE_LOST) lost_ = true;
  check(result, what);
}

void Device::log(uint32_t level, const char* format, ...) const {
  if (!log_->wanted()) return;
  char text[1024];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  log_->write(level, one_line(text, sizeof text).c_str());
}

}  // namespace ks
