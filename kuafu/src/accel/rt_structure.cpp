// SPDX-License-Identifier: Apache-2.0
#include "accel/rt_structure.h"

#include <utility>

#include "device/error.h"

namespace kuafu {
namespace {

constexpr uint64_t storage_alignment = 256;  // VkAccelerationStructureCreateInfoKHR::offset

uint64_t scratch_alignment_of(VkPhysicalDevice device) {
  VkPhysicalDeviceAccelerationStructurePropertiesKHR structure{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR};
  VkPhysicalDeviceProperties2 all{VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, &structure};
  vkGetPhysicalDeviceProperties2(device, &all);
  return structure.minAccelerationStructureScratchOffsetAlignment;
}

VkAccelerationStructureTypeKHR type_of(const RtInput& input) {
  return input.geometry.geometryType == VK_GEOMETRY_TYPE_INSTANCES_KHR ? VK_ACCELERATION_STRUCTURE_TYPE_TOP_LEVEL_KHR
                                                                       : VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR;
}

}  // namespace

RtStructure::RtStructure(std::shared_ptr<ks::Buffer> storage, uint64_t offset_bytes, uint64_t size_bytes,
                         VkAccelerationStructureTypeKHR type)
    : storage_(std::move(storage)) {
  const ks::Device& device = *storage_->device();
  VkAccelerationStructureCreateInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_CREATE_INFO_KHR};
  info.buffer = storage_->handle();
  info.offset = offset_bytes;
  info.size = size_bytes;
  info.type = type;
  ks::check(device.vk().vkCreateAccelerationStructureKHR(device.handle(), &info, nullptr, &handle_), "vkCreateAccelerationStructureKHR");
  VkAccelerationStructureDeviceAddressInfoKHR of{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_DEVICE_ADDRESS_INFO_KHR};
  of.accelerationStructure = handle_;
  address_ = device.vk().vkGetAccelerationStructureDeviceAddressKHR(device.handle(), &of);
}

RtStructure::~RtStructure() {
  if (storage_) storage_->device()->vk().vkDestroyAccelerationStructureKHR(storage_->device()->handle(), handle_, nullptr);
}

RtStructure::RtStructure(RtStructure&& other) noexcept
    : storage_(std::move(other.storage_)), handle_(std::exchange(other.handle_, VK_NULL_HANDLE)), address_(other.address_) {}

RtStructure& RtStructure::operator=(RtStructure&& other) noexcept {
  std::swap(storage_, other.storage_);
  std::swap(handle_, other.handle_);
  std::swap(address_, other.address_);
  return *this;
}

RtInput RtInput::triangles(uint64_t positions, uint32_t vertex_count, uint64_t indices, uint32_t triangle_count, bool updatable) {
  VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
  geometry.geometryType = VK_GEOMETRY_TYPE_TRIANGLES_KHR;
  geometry.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
  auto& triangles = geometry.geometry.triangles;
  triangles = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_TRIANGLES_DATA_KHR};
  triangles.vertexFormat = VK_FORMAT_R32G32B32_SFLOAT;
  triangles.vertexData.deviceAddress = positions;
  triangles.vertexStride = 3 * sizeof(float);
  triangles.maxVertex = vertex_count - 1;
  triangles.indexType = VK_INDEX_TYPE_UINT32;
  triangles.indexData.deviceAddress = indices;
  return {geometry, triangle_count, updatable};
}

RtInput RtInput::instances(uint64_t records, uint32_t count) {
  VkAccelerationStructureGeometryKHR geometry{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_KHR};
  geometry.geometryType = VK_GEOMETRY_TYPE_INSTANCES_KHR;
  geometry.flags = VK_GEOMETRY_OPAQUE_BIT_KHR;
  geometry.geometry.instances = {VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_GEOMETRY_INSTANCES_DATA_KHR};
  geometry.geometry.instances.data.deviceAddress = records;
  return {geometry, count, false};
}

RtBuilder::RtBuilder(std::shared_ptr<ks::Device> device)
    : device_(std::move(device)), scratch_alignment_(scratch_alignment_of(device_->physical())) {}

std::vector<RtStructure> RtBuilder::build(std::vector<RtInput> inputs, ArrayBuffer& storage) {
  Job job = describe(std::move(inputs), VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
  std::vector<RtStructure> structures = lay_out(job, storage);
  run(job);
  return structures;
}

std::vector<RtStructure> RtBuilder::plan(std::vector<RtInput> inputs, ArrayBuffer& storage) {
  planned_ = describe(std::move(inputs), VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR);
  return lay_out(*planned_, storage);
}

std::vector<RtStructure> RtBuilder::lay_out(Job& job, ArrayBuffer& storage) const {
  std::vector<RtStructure> structures;
  if (job.inputs.empty()) return structures;
  std::vector<uint64_t> offsets, storage_bytes;
  uint64_t end = 0;
  for (size_t i = 0; i < job.inputs.size(); ++i) {
    const auto needed = sizes(job.infos[i], job.inputs[i].primitives);
    job.scratch_bytes.push_back(needed.buildScratchSize);
    storage_bytes.push_back(needed.accelerationStructureSize);
    offsets.push_back(end);
    end = round_up(end + needed.accelerationStructureSize, storage_alignment);
  }
  storage.reserve(device_, end);
  structures.reserve(job.inputs.size());
  for (size_t i = 0; i < job.inputs.size(); ++i) {
    structures.emplace_back(storage.buffer(), offsets[i], storage_bytes[i], job.infos[i].type);
    job.infos[i].dstAccelerationStructure = structures[i].handle();
  }
  return structures;
}

void RtBuilder::refit(std::vector<RtInput> inputs, std::span<RtStructure* const> structures) {
  Job job = describe(std::move(inputs), VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR);
  for (size_t i = 0; i < job.inputs.size(); ++i) {
    job.scratch_bytes.push_back(sizes(job.infos[i], job.inputs[i].primitives).updateScratchSize);
    job.infos[i].srcAccelerationStructure = job.infos[i].dstAccelerationStructure = structures[i]->handle();
  }
  run(job);
}

RtBuilder::Job RtBuilder::describe(std::vector<RtInput> inputs, VkBuildAccelerationStructureModeKHR mode) {
  Job job{std::move(inputs), {}, {}};
  for (const RtInput& input : job.inputs) {
    VkAccelerationStructureBuildGeometryInfoKHR info{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_GEOMETRY_INFO_KHR};
    info.type = type_of(input);
    info.flags = VK_BUILD_ACCELERATION_STRUCTURE_PREFER_FAST_TRACE_BIT_KHR;
    if (input.updatable) info.flags |= VK_BUILD_ACCELERATION_STRUCTURE_ALLOW_UPDATE_BIT_KHR;
    info.mode = mode;
    info.geometryCount = 1;
    info.pGeometries = &input.geometry;
    job.infos.push_back(info);
  }
  return job;
}

VkAccelerationStructureBuildSizesInfoKHR RtBuilder::sizes(const VkAccelerationStructureBuildGeometryInfoKHR& info,
                                                          uint32_t primitives) const {
  VkAccelerationStructureBuildSizesInfoKHR sizes{VK_STRUCTURE_TYPE_ACCELERATION_STRUCTURE_BUILD_SIZES_INFO_KHR};
  device_->vk().vkGetAccelerationStructureBuildSizesKHR(device_->handle(), VK_ACCELERATION_STRUCTURE_BUILD_TYPE_DEVICE_KHR, &info,
                                                        &primitives, &sizes);
  return sizes;
}

/// Side by side: each has its own part of the scratch memory.
void RtBuilder::record(ks::Commands& commands, Job& job) {
  if (job.inputs.empty()) return;
  uint64_t total = scratch_alignment_;
  for (const uint64_t bytes : job.scratch_bytes) total += round_up(bytes, scratch_alignment_);
  scratch_.reserve(device_, total);
  uint64_t at = round_up(scratch_.address(), scratch_alignment_);
  std::vector<VkAccelerationStructureBuildRangeInfoKHR> ranges(job.infos.size());
  std::vector<const VkAccelerationStructureBuildRangeInfoKHR*> range_pointers(job.infos.size());
  for (size_t i = 0; i < job.infos.size(); ++i) {
    job.infos[i].scratchData.deviceAddress = at;
    at += round_up(job.scratch_bytes[i], scratch_alignment_);
    ranges[i].primitiveCount = job.inputs[i].primitives;
    range_pointers[i] = &ranges[i];
  }
  device_->vk().vkCmdBuildAccelerationStructuresKHR(commands.handle(), uint32_t(job.infos.size()), job.infos.data(), range_pointers.data());
  commands.barrier();
}

void RtBuilder::run(Job& job) {
  if (job.inputs.empty()) return;
  ks::Commands commands(device_);
  record(commands, job);
  commands.flush();
}

bool RtBuilder::record(ks::Commands& commands) {
  if (!planned_) return false;
  commands.begin_stage("acceleration build");
  record(commands, *planned_);
  planned_.reset();
  return true;
}

}  // namespace kuafu
