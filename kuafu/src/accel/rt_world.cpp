// SPDX-License-Identifier: Apache-2.0
#include "accel/rt_world.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "device/error.h"

namespace kuafu {
namespace {

constexpr uint32_t most_instances = 1u << 24;  // bits of instanceCustomIndex

VkAccelerationStructureInstanceKHR instance_record(const Placement& placement, uint32_t index, uint64_t bottom_address) {
  VkAccelerationStructureInstanceKHR record{};
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) record.transform.matrix[row][column] = float(placement.local_to_world[column][row]);
  record.instanceCustomIndex = index & (most_instances - 1);
  record.mask = 0xff;
  record.accelerationStructureReference = bottom_address;
  return record;
}

}  // namespace

struct RtWorld::Geometry {
  Geometry(const std::shared_ptr<ks::Device>& device, const Scene& scene, const std::vector<uint32_t>& ids, bool updatable) {
    std::vector<std::byte> bytes;
    const auto append = [&bytes](const auto& values) {
      const uint64_t offset = bytes.size();
      const auto added = std::as_bytes(std::span(values));
      bytes.insert(bytes.end(), added.begin(), added.end());
      return offset;
    };
    std::vector<std::pair<uint64_t, uint64_t>> offsets;
    for (const uint32_t id : ids) {
      const uint64_t positions = append(scene.meshes()[id].positions);
      offsets.emplace_back(positions, append(scene.meshes()[id].indices));
    }
    buffer.upload(device, bytes);
    for (size_t i = 0; i < ids.size(); ++i) {
      const Mesh& mesh = scene.meshes()[ids[i]];
      inputs.push_back(RtInput::triangles(buffer.address() + offsets[i].first, uint32_t(mesh.positions.size()),
                                          buffer.address() + offsets[i].second, uint32_t(mesh.indices.size()), updatable));
    }
  }
  ArrayBuffer buffer{rt_input_usage};
  std::vector<RtInput> inputs;
};

RtWorld::RtWorld(std::shared_ptr<ks::Device> device) : device_(std::move(device)), builder_(device_) {}

void RtWorld::update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) {
  if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
  if (std::exchange(scene_, nullptr) != scene.identity()) forget();  // and forget too what a failed update left
  if (!ray_times(scene, open).instant())
    ks::fail(KS_ERROR_UNSUPPORTED,
             "an instance moves while the shutter is open (%g to %g s), which VK_KHR_ray_tracing_pipeline cannot follow: use "
             "KUAFU_TRACER_COMPUTE, or set instances' velocities to 0 (cameras and lights may move)",
             open.from_s, open.until_s);
  const std::vector<uint32_t> deformed = follow_meshes(scene);
  const auto changed = changed_slots(scene, instances_revision_, deformed, placements_);
  const bool known = changed && environment_count == environment_count_;
  if (!known || !follow(scene, *changed, deformed)) place_all(scene, environment_count);
  instances_revision_ = scene.revisions().instances;
  scene_ = scene.identity();
}

void RtWorld::forget() {
  tops_.clear(), meshes_.clear(), placements_.clear(), watch_.forget();
  instances_revision_ = 0, environment_count_ = 0;
}

/// A mesh that deforms once is expected to deform again: from then on its bottom level can be refitted.
/// Returns those that deformed.
std::vector<uint32_t> RtWorld::follow_meshes(const Scene& scene) {
  MeshWatch::Changes changes = watch_.look(scene);
  std::vector<uint32_t> rebuilt, refitted;
  for (const uint32_t id : changes.removed) meshes_.erase(id);
  for (const uint32_t id : changes.deformed)
    (meshes_.at(id).updatable && meshes_.at(id).refits < most_refits ? refitted : rebuilt).push_back(id);
  build_meshes(scene, changes.added, false);
  build_meshes(scene, rebuilt, true);
  refit_meshes(scene, refitted);
  return std::move(changes.deformed);
}

void RtWorld::build_meshes(const Scene& scene, const std::vector<uint32_t>& ids, bool updatable) {
  if (ids.empty()) return;
  const Geometry geometry(device_, scene, ids, updatable);
  ArrayBuffer storage{rt_storage_usage, ArrayBuffer::Writer::device};  // the structures keep it
  std::vector<RtStructure> built = builder_.build(geometry.inputs, storage);
  for (size_t i = 0; i < ids.size(); ++i) meshes_.insert_or_assign(ids[i], Bottom{std::move(built[i]), updatable});
}

void RtWorld::refit_meshes(const Scene& scene, const std::vector<uint32_t>& ids) {
  if (ids.empty()) return;
  const Geometry geometry(device_, scene, ids, true);
  std::vector<RtStructure*> structures;
  for (const uint32_t id : ids) {
    structures.push_back(&meshes_.at(id).structure);
    ++meshes_.at(id).refits;
  }
  builder_.refit(geometry.inputs, structures);
}

void RtWorld::place_all(const Scene& scene, uint32_t environment_count) {
  placements_ = all_placements(scene, {});
  if (placements_.size() > most_instances)
    ks::fail(KS_ERROR_UNSUPPORTED, "%zu instances, ray tracing pipelines number at most %u: use KUAFU_TRACER_COMPUTE", placements_.size(),
             most_instances);
  seen_ = placements_by_environment(placements_, environment_count);
  records_.clear();
  for (const auto& slots : seen_)
    for (const uint32_t slot : slots) records_.push_back(record_of(slot));
  instances_.upload(device_, records_);
  environment_count_ = environment_count;
  build_tops();
}

/// false: what the environments see is not what it was, so that all must be placed again.
bool RtWorld::follow(const Scene& scene, const std::vector<uint32_t>& slots, const std::vector<uint32_t>& deformed) {
  if (scene.instance_slots().size() != placements_.size()) return false;
  std::vector<uint32_t> written;
  for (const uint32_t slot : slots) {
    const Placement now = placement_in(scene, slot, {}), before = std::exchange(placements_[slot], now);
    if (now.traceable != before.traceable || now.environment != before.environment) return false;
    if (!now.traceable || (now == before && !std::ranges::binary_search(deformed, now.mesh))) continue;
    uint32_t first = 0;
    for (const auto& seen : seen_) {
      const auto found = std::ranges::lower_bound(seen, slot);
      if (found != seen.end() && *found == slot) {
        written.push_back(first + uint32_t(found - seen.begin()));
        records_[written.back()] = record_of(slot);
      }
      first += uint32_t(seen.size());
    }
  }
  if (written.empty()) return true;
  instances_.upload_changed(device_, records_, std::move(written));
  build_tops();
  return true;
}

VkAccelerationStructureInstanceKHR RtWorld::record_of(uint32_t slot) const {
  return instance_record(placements_[slot], slot, meshes_.at(placements_[slot].mesh).structure.address());
}

void RtWorld::build_tops() {
  std::vector<RtInput> inputs;
  uint64_t at = instances_.address();
  for (const auto& slots : seen_) {
    if (!slots.empty()) inputs.push_back(RtInput::instances(at, uint32_t(slots.size())));
    at += slots.size() * sizeof(VkAccelerationStructureInstanceKHR);
  }
  tops_.clear();
  tops_ = builder_.plan(std::move(inputs), top_storage_);

  std::vector<uint64_t> addresses;
  addresses.reserve(seen_.size());
  size_t next = 0;
  for (const auto& slots : seen_) addresses.push_back(slots.empty() ? 0 : tops_[next++].address());
  addresses_.upload(device_, addresses);
}

}  // namespace kuafu
