// SPDX-License-Identifier: Apache-2.0
#include "accel/embree_world.h"

#include <algorithm>
#include <utility>

#include "accel/embree_cutout.h"
#include "accel/embree_motion.h"
#include "device/error.h"
#include "device/interrupt.h"

namespace kuafu {
namespace {

/// Whether an instance keeps its geometry: Embree's is made for a mesh, and for motion or none.
bool alike(const Placement& a, const Placement& b) { return a.mesh == b.mesh && a.sweep.has_value() == b.sweep.has_value(); }

void set_transform(RTCGeometry geometry, const Placement& placement) {
  if (placement.sweep) return set_motion(geometry, placement);
  const glm::mat4x3 columns(glm::dmat4x3{placement.local_to_world});
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &columns[0][0]);
  rtcCommitGeometry(geometry);
}

template <class T>
T* new_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, size_t count) {
  return static_cast<T*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), count));
}

constexpr size_t long_build = 1 << 15;  // primitives; takes about 10 ms

/// Builds the scene's tree. A caller who wants to end is heard while it is built.
void commit(RTCScene scene, size_t primitives) {
  ks::interruption_point();
  if (primitives < long_build) return rtcCommitScene(scene);
  rtcSetSceneProgressMonitorFunction(
      scene,
      [](void* of_call, double) {
        auto* const interrupt = static_cast<ks::Interrupt*>(of_call);
        if (interrupt != nullptr) interrupt->ask_now_and_then();  // where it is built in the caller's thread
        return interrupt == nullptr || !interrupt->requested();
      },
      ks::Interrupt::current());
  ks::Interrupt::watch([&] { rtcCommitScene(scene); });
  rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
}

}  // namespace

void EmbreeWorld::update(const Scene& scene, uint32_t environment_count, const TimeSpan& open) {
  if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
  check_embree_lives();
  if (std::exchange(scene_, nullptr) != scene.identity()) forget();  // and forget too what a failed update left
  follow_cutouts(scene);
  const std::vector<uint32_t> deformed = follow_meshes(scene);
  const auto changed = changed_slots(scene, instances_revision_, deformed, placements_);
  const TimeSpan times = ray_times(scene, open);
  const bool same_times = times == times_;
  times_ = times;
  if (changed && environment_count == environments_.size() && same_times)
    follow(scene, *changed);
  else
    place_all(scene, environment_count);
  device_.check("building the top level");
  instances_revision_ = scene.revisions().instances;
  scene_ = scene.identity();
}

void EmbreeWorld::forget() {
  cutouts_seen_ = {0, 0, 0, 0, 0};
  environments_.clear(), geometries_.clear(), apart_.clear(), placements_.clear(), meshes_.clear(), watch_.forget();
  instances_revision_ = 0;
  device_.forget_errors();
}

/// Returns the meshes that deformed.
std::vector<uint32_t> EmbreeWorld::follow_meshes(const Scene& scene) {
  MeshWatch::Changes changes = watch_.look(scene);
  for (const uint32_t id : changes.deformed) deform(scene.meshes()[id], meshes_[id]);
  for (const uint32_t id : changes.removed) meshes_.erase(id);
  for (const uint32_t id : changes.added) add_mesh(scene, id);
  return std::move(changes.deformed);
}

/// A mesh that shows its first cutout after it was built is rebuilt, and with it everything.
void EmbreeWorld::follow_cutouts(const Scene& scene) {
  const Revisions& now = scene.revisions();
  if (now.meshes == cutouts_seen_.meshes && now.materials == cutouts_seen_.materials && now.instances == cutouts_seen_.instances) return;
  cutouts_seen_ = now;
  cutouts_ = meshes_with_cutouts(scene);
  for (const auto& [id, mesh] : meshes_)
    if (cutouts_.contains(id) && !mesh.filtered) return forget();
}

void EmbreeWorld::add_mesh(const Scene& scene, uint32_t id) {
  const Mesh& mesh = scene.meshes()[id];
  Bottom bottom{device_.new_scene(), nullptr};
  bottom.filtered = cutouts_.contains(id);
  if (!mesh.indices.empty()) {
    bottom.geometry.reset(rtcNewGeometry(device_.handle(), RTC_GEOMETRY_TYPE_TRIANGLE));
    RTCGeometry geometry = bottom.geometry.get();
    auto* positions = new_buffer<glm::vec3>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh.positions.size());
    auto* indices = new_buffer<glm::uvec3>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh.indices.size());
    device_.check("taking a mesh's buffers");
    std::ranges::copy(mesh.positions, positions);
    std::ranges::copy(mesh.indices, indices);
    if (bottom.filtered) set_cutout_filter(geometry);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(bottom.scene.get(), geometry);
  }
  commit(bottom.scene.get(), mesh.indices.size());
  device_.check("building a mesh");
  meshes_.emplace(id, std::move(bottom));
}

/// A mesh that deforms once is expected to deform again: its scene then becomes one whose geometry Embree can refit.
void EmbreeWorld::deform(const Mesh& mesh, Bottom& bottom) {
  if (!bottom.geometry) return;
  RTCGeometry geometry = bottom.geometry.get();
  const bool refit = bottom.refittable && bottom.refits < most_refits;
  std::ranges::copy(mesh.positions, static_cast<glm::vec3*>(rtcGetGeometryBufferData(geometry, RTC_BUFFER_TYPE_VERTEX, 0)));
  rtcUpdateGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0);
  rtcSetGeometryBuildQuality(geometry, refit ? RTC_BUILD_QUALITY_REFIT : RTC_BUILD_QUALITY_MEDIUM);
  rtcCommitGeometry(geometry);
  // Only in such a scene has the geometry a tree of its own, with its own quality; measured: 100 times faster than to build.
  rtcSetSceneBuildQuality(bottom.scene.get(), RTC_BUILD_QUALITY_LOW);
  rtcSetSceneFlags(bottom.scene.get(), RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_DYNAMIC);
  commit(bottom.scene.get(), mesh.indices.size());
  device_.check("deforming a mesh");
  bottom.refittable = true;
  bottom.refits = refit ? bottom.refits + 1 : 0;
}

/// Returns whether the slot keeps its geometry.
bool EmbreeWorld::put(uint32_t slot, const Placement& p) {
  EmbreeGeometry& geometry = geometries_[slot];
  const bool same = p.traceable && geometry && alike(placements_[slot], p);
  if (!p.traceable) geometry.reset();
  if (p.traceable && !same) {
    geometry.reset(rtcNewGeometry(device_.handle(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(geometry.get(), meshes_.at(p.mesh).scene.get());
  }
  if (p.traceable) set_transform(geometry.get(), p);
  placements_[slot] = p;
  return same;
}

void EmbreeWorld::place_all(const Scene& scene, uint32_t environment_count) {
  geometries_.clear();
  geometries_.resize(scene.instance_slots().size());
  placements_.assign(geometries_.size(), {});
  for (uint32_t slot = 0; slot < geometries_.size(); ++slot) put(slot, placement_in(scene, slot, times_));
  attach_all(environment_count);
}

void EmbreeWorld::attach_all(uint32_t environment_count) {
  environments_.clear();
  apart_.assign(geometries_.size(), false);
  apart_count_ = 0;
  for (auto& slots : placements_by_environment(placements_, environment_count)) {
    Environment environment{device_.new_scene(), nullptr, std::move(slots), {}};
    for (uint32_t i = 0; i < environment.instances.size(); ++i) {
      rtcAttachGeometryByID(environment.scene.get(), geometries_[environment.instances[i]].get(), i);
      environment.places[environment.instances[i]] = i;
    }
    commit(environment.scene.get(), environment.instances.size());
    environments_.push_back(std::move(environment));
  }
}

void EmbreeWorld::follow(const Scene& scene, const std::vector<uint32_t>& slots) {
  if (slots.empty()) return;
  geometries_.resize(scene.instance_slots().size());
  placements_.resize(geometries_.size());
  apart_.resize(geometries_.size());
  if (fit_apart(slots)) return follow_apart(scene, slots);
  if (apart_count_ > 0) {
    for (const uint32_t slot : slots) put(slot, placement_in(scene, slot, times_));
    return attach_all(uint32_t(environments_.size()));
  }
  std::vector<bool> concerned(environments_.size());
  for (const uint32_t slot : slots) {
    const Placement before = placements_[slot];
    const bool same = put(slot, placement_in(scene, slot, times_));
    for (uint32_t e = 0; e < environments_.size(); ++e) {
      const bool after = placements_[slot].seen_by(e);
      if (!before.seen_by(e) && !after) continue;
      const bool stays = before.seen_by(e) && after && same;
      if (!stays) follow_in(environments_[e], slot, after ? geometries_[slot].get() : nullptr);
      concerned[e] = true;
    }
  }
  for (uint32_t e = 0; e < environments_.size(); ++e)
    if (concerned[e]) commit(environments_[e].scene.get(), environments_[e].instances.size());
}

/// The slot's geometry in this environment is now `geometry`, or none.
void EmbreeWorld::follow_in(Environment& environment, uint32_t slot, RTCGeometry geometry) {
  const auto place = environment.places.find(slot);
  if (place != environment.places.end()) {
    rtcDetachGeometry(environment.scene.get(), place->second);
    environment.places.erase(place);
  }
  if (geometry == nullptr) return;
  const uint32_t id = rtcAttachGeometry(environment.scene.get(), geometry);
  if (id >= environment.instances.size()) environment.instances.resize(id + 1);
  environment.instances[id] = slot;
  environment.places[slot] = id;
}

/// Whether an environment is so large, and all that moved are so few, that a second scene over them costs less than to build the first.
bool EmbreeWorld::fit_apart(const std::vector<uint32_t>& slots) const {
  constexpr size_t large = 512, few = 256;  // measured: rays lose 2 % to 64 instances apart, 5 % to 256
  if (std::ranges::none_of(environments_, [&](const Environment& e) { return e.instances.size() >= large; })) return false;
  return apart_count_ + size_t(std::ranges::count_if(slots, [&](uint32_t slot) { return !apart_[slot]; })) <= few;
}

/// In the first scenes the slot shows nothing from now on. They are not rebuilt: Embree's traversal asks an instance for what it shows,
/// and boxes that are too large do no harm.
void EmbreeWorld::take_apart(uint32_t slot) {
  if (apart_[slot]) return;
  if (!nothing_) {
    nothing_ = device_.new_scene();
    rtcCommitScene(nothing_.get());
  }
  if (geometries_[slot]) {
    rtcSetGeometryInstancedScene(geometries_[slot].get(), nothing_.get());
    rtcCommitGeometry(geometries_[slot].get());
    geometries_[slot].reset();
  }
  apart_[slot] = true;
  ++apart_count_;
}

void EmbreeWorld::follow_apart(const Scene& scene, const std::vector<uint32_t>& slots) {
  std::vector<bool> concerned(environments_.size());
  for (const uint32_t slot : slots) {
    const Placement before = placements_[slot];
    const bool attached = apart_[slot];
    take_apart(slot);
    const bool same = put(slot, placement_in(scene, slot, times_));
    for (uint32_t e = 0; e < environments_.size(); ++e) {
      Environment& environment = environments_[e];
      const bool there = attached && before.seen_by(e), after = placements_[slot].seen_by(e), stays = there && after && same;
      if (!there && !after) continue;
      if (!environment.apart) environment.apart = device_.new_scene();
      const auto [place, is_new] = environment.places.try_emplace(slot, uint32_t(environment.instances.size()));
      if (is_new) environment.instances.push_back(slot);
      if (there && !stays) rtcDetachGeometry(environment.apart.get(), place->second);
      if (after && !stays) rtcAttachGeometryByID(environment.apart.get(), geometries_[slot].get(), place->second);
      concerned[e] = true;
    }
  }
  for (uint32_t e = 0; e < environments_.size(); ++e)
    if (concerned[e]) commit(environments_[e].apart.get(), apart_count_);
}

}  // namespace kuafu
