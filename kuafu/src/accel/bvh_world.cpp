// SPDX-License-Identifier: Apache-2.0
#include "accel/bvh_world.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "device/error.h"
#include "device/interrupt.h"
#include "device/thread_pool.h"
#include "scene/box_corners.h"
#include "scene/motion.h"

namespace kuafu {
namespace {

/// A refitted tree that costs more than this times what it did when it was built is rebuilt.
constexpr double worn_out = 1.5;

/// A node whose inner children's indices count from elsewhere.
BvhNode moved_by(uint32_t first, BvhNode node) {
  for (uint32_t* code : {&node.child0, &node.child1})
    if (!(*code & bvh_leaf)) *code += first;
  return node;
}

double farthest_corner_m(const Box& local, const glm::dmat4& local_to_world, const glm::dvec3& from) {
  double farthest = 0.0;
  for (const glm::dvec3& corner : box_corners(local))
    farthest = std::max(farthest, glm::length(glm::dvec3(local_to_world * glm::dvec4(corner, 1.0)) - from));
  return farthest;
}

/// World box of all places that a box sweeps: boxes at steps, and what a point's arc may leave its chord between them.
Box swept_box(const Box& local, const Placement& placement) {
  constexpr double radians_per_step = 0.1;
  const Sweep& sweep = *placement.sweep;
  const double seconds = sweep.span.until_s - sweep.span.from_s, rate = glm::length(sweep.motion.angular);
  const int steps = int(std::clamp(std::ceil(rate * seconds / radians_per_step), 1.0, 256.0));
  Box box;
  for (int i = 0; i <= steps; ++i) {
    const double t = glm::mix(sweep.span.from_s, sweep.span.until_s, double(i) / steps);
    box.add(world_box(local, sweep.motion.at(t) * placement.local_to_world));
  }
  const double speed = glm::length(sweep.motion.linear) + rate * farthest_corner_m(local, placement.local_to_world, sweep.motion.pivot);
  const double step_s = seconds / steps,
               sag = step_s * step_s / 8 * rate * speed;  // acceleration of a screw's points is at most rate * speed
  // Rays are taken back in float: its rounding too.
  const glm::vec3 size = glm::max(glm::abs(box.min), glm::abs(box.max));
  const float grow = float(sag) + 1e-6f * std::max({size.x, size.y, size.z});
  box.min -= grow, box.max += grow;
  return box;
}

/// World box of an instance, of all places that it passes where it moves. local: of its mesh.
Box placement_box(const Box& local, const Placement& placement) {
  return placement.sweep ? swept_box(local, placement) : world_box(local, placement.local_to_world);
}

}  // namespace

void BvhWorld::update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) {
  if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
  if (std::exchange(scene_, nullptr) != scene.identity()) forget();  // and forget too what a failed update left
  const std::vector<uint32_t> deformed = follow_meshes(scene);
  const auto changed = changed_slots(scene, instances_revision_, deformed, placements_);
  const TimeSpan times = ray_times(scene, open);
  const bool same_times = times == times_;
  times_ = times;
  if (changed && environment_count == environment_count_ && same_times)
    follow(scene, *changed);
  else
    place_all(scene, environment_count);
  instances_revision_ = scene.revisions().instances;
  scene_ = scene.identity();
}

void BvhWorld::forget() {
  meshes_.clear(), watch_.forget();
  instances_revision_ = 0, environment_count_ = 0;
  all_roots_.clear();
}

/// Returns the meshes that deformed.
std::vector<uint32_t> BvhWorld::follow_meshes(const Scene& scene) {
  const MeshWatch::Changes changes = watch_.look(scene);
  const std::vector<uint32_t>& deformed = changes.deformed;
  device_->workers().parallel_for(deformed.size(), [&](size_t i) { deform(scene.meshes()[deformed[i]], meshes_.at(deformed[i])); });
  for (const uint32_t id : deformed) upload(meshes_[id]);
  for (const uint32_t id : changes.removed) meshes_.erase(id);
  if (!changes.added.empty()) add_meshes(scene, changes.added);
  return deformed;
}

/// All meshes that are new go into one allocation: nodes of 64 and triangles of 48 bytes, mesh after mesh.
void BvhWorld::add_meshes(const Scene& scene, const std::vector<uint32_t>& ids) {
  std::vector<MeshBvh> built(ids.size());
  device_->workers().parallel_for(ids.size(), [&](size_t i) { built[i] = build_mesh_bvh(scene.meshes()[ids[i]]); });
  std::vector<std::byte> bytes;
  uint64_t most_bytes = 0;
  for (const MeshBvh& mesh : built)
    most_bytes += mesh.nodes.size() * sizeof(BvhNode) + mesh.triangles.size() * sizeof(BvhTriangle) + sizeof(BvhNode);
  bytes.reserve(most_bytes);
  const auto append = [&bytes](const auto& values) {
    ks::interruption_point();
    bytes.resize((bytes.size() + sizeof(BvhNode) - 1) / sizeof(BvhNode) * sizeof(BvhNode));  // a node in one cache line
    const size_t offset = bytes.size();
    const auto span = std::as_bytes(std::span(values));
    bytes.insert(bytes.end(), span.begin(), span.end());
    return offset;
  };
  for (size_t i = 0; i < ids.size(); ++i) {
    const uint64_t nodes = append(built[i].nodes);
    meshes_[ids[i]] = {nodes, append(built[i].triangles), built[i].bounds, nullptr, nullptr};
  }
  ArrayBuffer block;
  block.upload(device_, bytes);
  for (const uint32_t id : ids) {
    PlacedMesh& placed = meshes_[id];
    placed.nodes += block.address();
    placed.triangles += block.address();
    placed.block = block.buffer();
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
  placed.block.reset();
  placed.nodes = state.block.address();
  placed.triangles = state.block.address() + most_node_bytes;
}

void BvhWorld::put(uint32_t slot, const Placement& p) {
  placements_[slot] = p;
  if (moves()) motion_records_[slot] = p.sweep ? motion_record(p.sweep->motion) : MotionRecord{};
  if (!p.traceable) return;
  const PlacedMesh& mesh = meshes_.at(p.mesh);
  const glm::mat4 rows(glm::transpose(p.world_to_local));
  boxes_[slot] = placement_box(mesh.bounds, p);
  records_[slot] = {rows[0], rows[1], rows[2], mesh.nodes, mesh.triangles};
}

void BvhWorld::place_all(const Scene& scene, uint32_t environment_count) {
  const std::vector<Placement> placements = all_placements(scene, times_);
  placements_.resize(placements.size());
  boxes_.resize(placements.size());
  records_.resize(placements.size());
  motion_records_.resize(moves() ? placements.size() : 0);
  for (uint32_t slot = 0; slot < placements.size(); ++slot) put(slot, placements[slot]);
  const auto seen = placements_by_environment(placements_, environment_count);
  parts_.clear();
  parts_.resize(environment_count);
  device_->workers().parallel_for(environment_count, [&](size_t e) { parts_[e].top.build(seen[e], boxes_); });
  instances_.upload(device_, records_);
  motions_.upload(device_, motion_records_);
  upload_all_tops();
  environment_count_ = environment_count;
}

void BvhWorld::follow(const Scene& scene, const std::vector<uint32_t>& slots) {
  if (slots.empty()) return;
  placements_.resize(scene.instance_slots().size());
  boxes_.resize(placements_.size());
  records_.resize(placements_.size());
  motion_records_.resize(moves() ? placements_.size() : 0);
  for (const uint32_t slot : slots) {
    const Placement before = placements_[slot];
    put(slot, placement_in(scene, slot, times_));
    for (uint32_t e = 0; e < environment_count_; ++e) follow_in(e, slot, before.seen_by(e), placements_[slot].seen_by(e));
  }
  for (uint32_t e = 0; e < environment_count_; ++e)
    if (parts_[e].top.worn_out()) build(e);
  instances_.upload_changed(device_, records_, slots);
  if (moves()) motions_.upload_changed(device_, motion_records_, slots);
  upload_tops();
}

void BvhWorld::follow_in(uint32_t environment, uint32_t slot, bool before, bool after) {
  TopLevel& top = parts_[environment].top;
  if (before && after) {
    top.move(slot, boxes_[slot]);
  } else if (before) {
    top.erase(slot);
  } else if (after && !top.insert(slot, boxes_[slot])) {
    build(environment);
  }
}

void BvhWorld::build(uint32_t environment) {
  std::vector<uint32_t> slots;
  for (uint32_t slot = 0; slot < placements_.size(); ++slot)
    if (placements_[slot].seen_by(environment)) slots.push_back(slot);
  parts_[environment].top.build(slots, boxes_);
}

void BvhWorld::upload_tops() {
  std::vector<uint32_t> changed;
  for (Part& part : parts_) {
    if (part.top.nodes().size() > part.capacity) return upload_all_tops();
    for (const uint32_t n : part.top.take_changes()) {
      all_nodes_[part.first + n] = moved_by(part.first, part.top.nodes()[n]);
      changed.push_back(part.first + n);
    }
  }
  nodes_.upload_changed(device_, all_nodes_, std::move(changed));
  upload_roots();
}

void BvhWorld::upload_all_tops() {
  uint64_t end = 0;
  for (Part& part : parts_) {
    const auto count = uint32_t(part.top.nodes().size());
    part.first = uint32_t(end);
    part.capacity = count + count / 4 + 1;
    end += part.capacity;
    if (end >= bvh_leaf) ks::fail(KS_ERROR_UNSUPPORTED, "more than 2^31 top-level nodes over %zu environments", parts_.size());
  }
  all_nodes_.assign(end, {});
  for (Part& part : parts_) {
    for (size_t n = 0; n < part.top.nodes().size(); ++n) all_nodes_[part.first + n] = moved_by(part.first, part.top.nodes()[n]);
    part.top.take_changes();
  }
  nodes_.upload(device_, all_nodes_);
  upload_roots();
}

void BvhWorld::upload_roots() {
  std::vector<uint32_t> roots;
  for (const Part& part : parts_) roots.push_back(part.top.empty() ? bvh_done : part.first);
  if (roots == all_roots_) return;
  roots_.upload(device_, roots);
  all_roots_ = std::move(roots);
}

}  // namespace kuafu
