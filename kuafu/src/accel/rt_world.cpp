#include "accel/rt_world.h"

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

void RtWorld::update(const Scene& scene, uint32_t environment_count) {
  if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
  if (std::exchange(scene_, nullptr) != &scene) forget();  // and forget too what a failed update left
  const bool deformed = follow_meshes(scene), recounted = environment_count != environment_count_;
  if (deformed || recounted || scene.revisions().instances != instances_revision_) {
    std::vector<Placement> placements = all_placements(scene);
    if (deformed || recounted || placements != placements_) place(std::move(placements), environment_count);
    instances_revision_ = scene.revisions().instances;
  }
  scene_ = &scene;
}

void RtWorld::forget() {
  tops_.clear(), meshes_.clear(), placements_.clear(), watch_.forget();
  instances_revision_ = 0, environment_count_ = 0;
}

/// A mesh that deforms once is expected to deform again: from then on its bottom level can be refitted.
bool RtWorld::follow_meshes(const Scene& scene) {
  const MeshWatch::Changes changes = watch_.look(scene);
  std::vector<uint32_t> added, rebuilt, refitted;
  for (uint32_t id = changes.first_new; id < scene.meshes().size(); ++id)
    if (!scene.meshes()[id].removed) added.push_back(id);
  for (const uint32_t id : changes.removed) meshes_[id].reset();
  for (const uint32_t id : changes.deformed)
    (meshes_[id]->updatable && meshes_[id]->refits < most_refits ? refitted : rebuilt).push_back(id);
  meshes_.resize(scene.meshes().size());
  build_meshes(scene, added, false);
  build_meshes(scene, rebuilt, true);
  refit_meshes(scene, refitted);
  return !changes.deformed.empty();
}

void RtWorld::build_meshes(const Scene& scene, const std::vector<uint32_t>& ids, bool updatable) {
  if (ids.empty()) return;
  const Geometry geometry(device_, scene, ids, updatable);
  ArrayBuffer storage{rt_storage_usage};  // the structures keep it
  std::vector<RtStructure> built = builder_.build(geometry.inputs, storage);
  for (size_t i = 0; i < ids.size(); ++i) meshes_[ids[i]].emplace(Bottom{std::move(built[i]), updatable});
}

void RtWorld::refit_meshes(const Scene& scene, const std::vector<uint32_t>& ids) {
  if (ids.empty()) return;
  const Geometry geometry(device_, scene, ids, true);
  std::vector<RtStructure*> structures;
  for (const uint32_t id : ids) {
    structures.push_back(&meshes_[id]->structure);
    ++meshes_[id]->refits;
  }
  builder_.refit(geometry.inputs, structures);
}

void RtWorld::place(std::vector<Placement> placements, uint32_t environment_count) {
  if (placements.size() > most_instances)
    ks::fail(KS_ERROR_UNSUPPORTED, "%zu instances, ray tracing pipelines number at most %u: use KUAFU_TRACER_COMPUTE", placements.size(),
             most_instances);
  const auto seen = placements_by_environment(placements, environment_count);
  std::vector<VkAccelerationStructureInstanceKHR> records;
  for (const auto& indices : seen)
    for (const uint32_t i : indices) records.push_back(instance_record(placements[i], i, meshes_[placements[i].mesh]->structure.address()));
  instances_.upload(device_, records);

  std::vector<RtInput> inputs;
  uint64_t at = instances_.address();
  for (const auto& indices : seen) {
    if (!indices.empty()) inputs.push_back(RtInput::instances(at, uint32_t(indices.size())));
    at += indices.size() * sizeof(VkAccelerationStructureInstanceKHR);
  }
  tops_.clear();
  tops_ = builder_.build(inputs, top_storage_);

  std::vector<uint64_t> addresses;
  addresses.reserve(seen.size());
  size_t next = 0;
  for (const auto& indices : seen) addresses.push_back(indices.empty() ? 0 : tops_[next++].address());
  addresses_.upload(device_, addresses);
  placements_ = std::move(placements);
  environment_count_ = environment_count;
}

}  // namespace kuafu
