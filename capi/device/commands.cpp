// SPDX-License-Identifier: Apache-2.0
#include <chrono>

#include "device/compute.h"
#include "device/error.h"
#include "device/interrupt.h"
#include "device/stage_clock.h"
#include "device/timeline.h"

namespace ks {
namespace {

using ull = unsigned long long;

/// Stages and accesses of a device's commands, for its barriers.
struct Work {
  VkPipelineStageFlags stages = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT;
  VkAccessFlags writes = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
  VkAccessFlags reads = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_INDIRECT_COMMAND_READ_BIT;

  explicit Work(const Device& device) {
    if (!(device.info().capabilities & KS_CAP_RAY_TRACING_PIPELINE)) return;
    stages |= VK_PIPELINE_STAGE_RAY_TRACING_SHADER_BIT_KHR | VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
    writes |= VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;
    reads |= VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR;
  }
};

void check_extent(const Buffer& buffer, uint64_t offset_bytes, uint64_t size_bytes, const char* what) {
  if (offset_bytes > buffer.size_bytes() || size_bytes > buffer.size_bytes() - offset_bytes)
    fail(KS_ERROR_INTERNAL, "%s of %llu bytes at offset %llu leaves the buffer of %llu bytes", what, static_cast<ull>(size_bytes),
         static_cast<ull>(offset_bytes), static_cast<ull>(buffer.size_bytes()));
}

}  // namespace

struct Commands::State {
  explicit State(std::shared_ptr<Device> d) : device(std::move(d)), work(*device), clock(device) {}
  ~State() {
    if (pool != VK_NULL_HANDLE) device->vk().vkDestroyCommandPool(device->handle(), pool, nullptr);
  }
  VkCommandBuffer begun();
  VkCommandBuffer ended();
  void collect();
  void barrier(VkPipelineStageFlags to, VkAccessFlags accesses);
  void work_barrier() { barrier(work.stages | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, work.writes | work.reads); }
  void done() {
    if (automatic_barriers) work_barrier();
  }
  void bind(const ComputePipeline& pipeline, const void* push, size_t push_bytes);

  std::shared_ptr<Device> device;
  const Work work;
  VkCommandPool pool = VK_NULL_HANDLE;
  VkCommandBuffer buffer = VK_NULL_HANDLE;
  StageClock clock;
  std::chrono::steady_clock::time_point start;  // of the submission
  bool recording = false, submitted = false;
  bool automatic_barriers = true;
};

Commands::Commands(std::shared_ptr<Device> device) : state_(std::make_unique<State>(std::move(device))) {
  Device& d = *state_->device;
  if (!d.has_vulkan()) fail(KS_ERROR_UNSUPPORTED, "compute work needs a Vulkan device, this is the host device");
  VkCommandPoolCreateInfo pool{VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO};
  pool.queueFamilyIndex = d.queue_family();
  check(d.vk().vkCreateCommandPool(d.handle(), &pool, nullptr, &state_->pool), "vkCreateCommandPool");
  VkCommandBufferAllocateInfo buffer{VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO};
  buffer.commandPool = state_->pool;
  buffer.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  buffer.commandBufferCount = 1;
  check(d.vk().vkAllocateCommandBuffers(d.handle(), &buffer, &state_->buffer), "vkAllocateCommandBuffers");
}

Commands::~Commands() = default;

VkCommandBuffer Commands::State::begun() {
  if (recording) return buffer;
  if (submitted) fail(KS_ERROR_INTERNAL, "commands are recorded while what was submitted may still run: finish() it first");
  check(device->vk().vkResetCommandPool(device->handle(), pool, 0), "vkResetCommandPool");
  VkCommandBufferBeginInfo info{VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO};
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  check(device->vk().vkBeginCommandBuffer(buffer, &info), "vkBeginCommandBuffer");
  recording = true;
  clock.begin_recording(buffer);
  return buffer;
}

void Commands::State::barrier(VkPipelineStageFlags to, VkAccessFlags accesses) {
  VkMemoryBarrier memory{VK_STRUCTURE_TYPE_MEMORY_BARRIER};
  memory.srcAccessMask = work.writes;
  memory.dstAccessMask = accesses;
  device->vk().vkCmdPipelineBarrier(begun(), work.stages, to, 0, 1, &memory, 0, nullptr, 0, nullptr);
}

void Commands::State::bind(const ComputePipeline& pipeline, const void* push, size_t push_bytes) {
  if (push_bytes != pipeline.push_constant_bytes())
    fail(KS_ERROR_INTERNAL, "a dispatch gives %zu bytes of push constants to a pipeline made for %u", push_bytes,
         pipeline.push_constant_bytes());
  device->vk().vkCmdBindPipeline(begun(), VK_PIPELINE_BIND_POINT_COMPUTE, pipeline.handle());
  if (push_bytes > 0)
    device->vk().vkCmdPushConstants(buffer, pipeline.layout(), VK_SHADER_STAGE_COMPUTE_BIT, 0, static_cast<uint32_t>(push_bytes), push);
}

uint32_t Commands::most_groups() const { return state_->device->limits().maxComputeWorkGroupCount[0]; }

void Commands::dispatch_raw(const ComputePipeline& pipeline, const void* push, size_t push_bytes, uint32_t x, uint32_t y, uint32_t z) {
  if (x == 0 || y == 0 || z == 0) return;
  const uint32_t(&most)[3] = state_->device->limits().maxComputeWorkGroupCount;
  if (x > most[0] || y > most[1] || z > most[2])
    fail(KS_ERROR_INTERNAL, "a dispatch of %u x %u x %u groups is beyond the device's %u x %u x %u: split it", x, y, z, most[0], most[1],
         most[2]);
  state_->bind(pipeline, push, push_bytes);
  state_->device->vk().vkCmdDispatch(state_->buffer, x, y, z);
  state_->done();
}

void Commands::dispatch_indirect_raw(const ComputePipeline& pipeline, const void* push, size_t push_bytes, const Buffer& arguments,
                                     uint64_t offset_bytes) {
  check_extent(arguments, offset_bytes, sizeof(VkDispatchIndirectCommand), "indirect arguments");
  state_->bind(pipeline, push, push_bytes);
  state_->device->vk().vkCmdDispatchIndirect(state_->buffer, arguments.handle(), offset_bytes);
  state_->done();
}

void Commands::fill(const Buffer& buffer, uint64_t offset_bytes, uint64_t size_bytes, uint32_t value) {
  check_extent(buffer, offset_bytes, size_bytes, "a fill");
  if (offset_bytes % 4 != 0 || size_bytes % 4 != 0)
    fail(KS_ERROR_INTERNAL, "a fill of %llu bytes at offset %llu: both must be multiples of 4", static_cast<ull>(size_bytes),
         static_cast<ull>(offset_bytes));
  if (size_bytes == 0) return;
  state_->device->vk().vkCmdFillBuffer(state_->begun(), buffer.handle(), offset_bytes, size_bytes, value);
  state_->done();
}

void Commands::update(const Buffer& buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes) {
  constexpr uint64_t most_bytes = 65536;
  check_extent(buffer, offset_bytes, size_bytes, "an update");
  if (offset_bytes % 4 != 0 || size_bytes % 4 != 0 || size_bytes > most_bytes)
    fail(KS_ERROR_INTERNAL, "an update of %llu bytes at offset %llu: both must be multiples of 4, and at most %llu bytes",
         static_cast<ull>(size_bytes), static_cast<ull>(offset_bytes), static_cast<ull>(most_bytes));
  if (size_bytes == 0) return;
  state_->device->vk().vkCmdUpdateBuffer(state_->begun(), buffer.handle(), offset_bytes, size_bytes, data);
  state_->done();
}

void Commands::copy(const Buffer& from, uint64_t from_offset, const Buffer& to, uint64_t to_offset, uint64_t size_bytes) {
  check_extent(from, from_offset, size_bytes, "a copy's source");
  check_extent(to, to_offset, size_bytes, "a copy's target");
  if (size_bytes == 0) return;
  const VkBufferCopy region{from_offset, to_offset, size_bytes};
  state_->device->vk().vkCmdCopyBuffer(state_->begun(), from.handle(), to.handle(), 1, &region);
  state_->device->count_copy(size_bytes);
  state_->done();
}

void Commands::barrier() { state_->work_barrier(); }

void Commands::set_automatic_barriers(bool on) { state_->automatic_barriers = on; }

VkCommandBuffer Commands::State::ended() {
  barrier(VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT | VK_ACCESS_HOST_WRITE_BIT);
  clock.end_recording(buffer);
  recording = false;
  check(device->vk().vkEndCommandBuffer(buffer), "vkEndCommandBuffer");
  start = std::chrono::steady_clock::now();
  return buffer;
}

void Commands::State::collect() {
  clock.collect(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
}

void Commands::flush() {
  if (!state_->recording) return;
  interruption_point();
  state_->device->submit_and_wait(state_->ended());
  state_->collect();
}

void Commands::submit(const Timeline& timeline, uint64_t value, const TimelinePoint& wait) {
  (void)state_->begun();  // an empty submission still reaches its value
  state_->device->submit(state_->ended(), timeline.handle(), value, wait.timeline ? wait.timeline->handle() : VK_NULL_HANDLE, wait.value);
  state_->submitted = true;
}

void Commands::finish() {
  if (state_->submitted) state_->collect();
  state_->submitted = false;
}

void Commands::begin_stage(const char* name) { state_->clock.begin_stage(name, state_->recording ? state_->buffer : VK_NULL_HANDLE); }

std::vector<std::pair<std::string, double>> Commands::stage_times() const { return state_->clock.times(); }

void Commands::reset_stage_times() { state_->clock.reset_times(); }

void Commands::add_host_time(const char* name, double milliseconds) { state_->clock.add(name, milliseconds); }

const std::shared_ptr<Device>& Commands::device() const { return state_->device; }

VkCommandBuffer Commands::handle() { return state_->begun(); }

}  // namespace ks
