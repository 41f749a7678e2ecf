#include "accel/bvh_world.h"

#include <utility>

#include "accel/instance_bvh.h"
#include "device/error.h"

namespace kuafu {
namespace {

/// A refitted tree that costs more than this times what it did when it was built is built anew.
constexpr double worn_out = 1.5;

}  // namespace

void BvhWorld::update(const Scene& scene, uint32_t environment_count) {
  if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
  if (std::exchange(scene_, nullptr) != &scene) forget();  // and forget too what a failed update left
  const std::vector<uint32_t> deformed = watch_.look(scene).deformed;
  device_->workers().parallel_for(deformed.size(), [&](size_t i) { deform(scene.meshes()[deformed[i]], meshes_[deformed[i]]); });
  for (const uint32_t id : deformed) upload(meshes_[id]);
  if (meshes_.size() < scene.meshes().size()) add_meshes(scene);
  const bool must_place = !deformed.empty() || environment_count != environment_count_;
  if (must_place || scene.revisions().instances != instances_revision_) {
    std::vector<Placement> placements = live_placements(scene);
    if (must_place || placements != placements_) place(std::move(placements), environment_count);
    instances_revision_ = scene.revisions().instances;
  }
  scene_ = &scene;
}

void BvhWorld::forget() {
  blocks_.clear(), meshes_.clear(), placements_.clear(), watch_.forget();
  instances_revision_ = 0, environment_count_ = 0;
}

/// All meshes that are new go into one allocation: nodes of 64 and triangles of 48 bytes, mesh after mesh.
void BvhWorld::add_meshes(const Scene& scene) {
  const size_t first = meshes_.size();
  std::vector<MeshBvh> built(scene.meshes().size() - first);
  device_->workers().parallel_for(built.size(), [&](size_t i) { built[i] = build_mesh_bvh(scene.meshes()[first + i]); });
  std::vector<std::byte> bytes;
  const auto append = [&bytes](const auto& values) {
    bytes.resize((bytes.size() + sizeof(BvhNode) - 1) / sizeof(BvhNode) * sizeof(BvhNode));  // a node in one cache line
    const size_t offset = bytes.size();
    const auto span = std::as_bytes(std::span(values));
    bytes.insert(bytes.end(), span.begin(), span.end());
    return offset;
  };
  for (const MeshBvh& mesh : built) {
    const uint64_t nodes = append(mesh.nodes);
    meshes_.push_back({nodes, append(mesh.triangles), mesh.bounds, nullptr});
  }
  blocks_.emplace_back().upload(device_, bytes);
  for (size_t i = first; i < meshes_.size(); ++i) {
    meshes_[i].nodes += blocks_.back().address();
    meshes_[i].triangles += blocks_.back().address();
  }
}

void BvhWorld::deform(const Mesh& mesh, PlacedMesh& placed) const {
  const bool known = placed.deforming != nullptr;
  if (!known) placed.deforming = std::make_unique<Deforming>();
  Deforming& state = *placed.deforming;
  if (known) refit_mesh_bvh(state.bvh, mesh);
  if (!known || expected_cost(state.bvh.nodes) > worn_out * state.cost_when_built) {
    state.bvh = build_mesh_bvh(mesh);
    state.cost_when_built = expected_cost(state.bvh.nodes);
  }
  placed.bounds = state.bvh.bounds;
}

void BvhWorld::upload(PlacedMesh& placed) const {
  Deforming& state = *placed.deforming;
  const uint64_t triangle_count = state.bvh.triangles.size();
  const uint64_t most_node_bytes = triangle_count * sizeof(BvhNode);  // no tree has more nodes, so that a rebuilt one fits as well
  state.block.reserve(device_, most_node_bytes + triangle_count * sizeof(BvhTriangle));
  state.block.write(0, state.bvh.nodes);
  state.block.write(most_node_bytes, state.bvh.triangles);
  placed.nodes = state.block.address();
  placed.triangles = state.block.address() + most_node_bytes;
}

void BvhWorld::place(std::vector<Placement> placements, uint32_t environment_count) {
  std::vector<Box> bounds;
  for (const PlacedMesh& mesh : meshes_) bounds.push_back(mesh.bounds);
  const InstanceBvhs top = build_instance_bvhs(placements, bounds, environment_count, device_->workers());
  std::vector<BvhInstance> records;
  records.reserve(placements.size());
  for (const Placement& p : placements) {
    const glm::mat4 rows(glm::transpose(p.world_to_local));
    records.push_back({rows[0], rows[1], rows[2], meshes_[p.mesh].nodes, meshes_[p.mesh].triangles});
  }
  nodes_.upload(device_, top.nodes);
  instances_.upload(device_, records);
  roots_.upload(device_, top.roots);
  placements_ = std::move(placements);
  environment_count_ = environment_count;
}

}  // namespace kuafu
