#include "accel/embree_world.h"

#include <algorithm>
#include <utility>

#include "device/error.h"

namespace kuafu {
namespace {

void set_transform(RTCGeometry geometry, const glm::dmat4& local_to_world) {
  const glm::mat4x3 columns(glm::dmat4x3{local_to_world});
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, &columns[0][0]);
  rtcCommitGeometry(geometry);
}

template <class T>
T* new_buffer(RTCGeometry geometry, RTCBufferType type, RTCFormat format, size_t count) {
  return static_cast<T*>(rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), count));
}

}  // namespace

void EmbreeWorld::update(const Scene& scene, uint32_t environment_count) {
  if (environment_count == 0) ks::fail(KS_ERROR_INVALID_ARGUMENT, "a tracer needs at least one environment");
  if (std::exchange(scene_, nullptr) != &scene) forget();  // and forget too what a failed update left
  const std::vector<uint32_t> deformed = watch_.look(scene).deformed;
  for (const uint32_t id : deformed) deform(scene.meshes()[id], meshes_[id]);
  while (meshes_.size() < scene.meshes().size()) add_mesh(scene.meshes()[meshes_.size()]);
  const bool same_count = environment_count == environments_.size();
  if (!same_count || !deformed.empty() || scene.revisions().instances != instances_revision_) {
    std::vector<Placement> placements = live_placements(scene);
    if (same_count && only_moved(placements))
      move(placements, deformed);
    else
      place(placements, environment_count);
    device_.check("building the top level");
    placements_ = std::move(placements);
    instances_revision_ = scene.revisions().instances;
  }
  scene_ = &scene;
}

void EmbreeWorld::forget() {
  environments_.clear(), geometries_.clear(), placements_.clear(), meshes_.clear(), watch_.forget();
  instances_revision_ = 0;
}

void EmbreeWorld::add_mesh(const Mesh& mesh) {
  Bottom bottom{device_.new_scene(), nullptr};
  if (!mesh.indices.empty()) {
    bottom.geometry.reset(rtcNewGeometry(device_.handle(), RTC_GEOMETRY_TYPE_TRIANGLE));
    RTCGeometry geometry = bottom.geometry.get();
    auto* positions = new_buffer<glm::vec3>(geometry, RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, mesh.positions.size());
    auto* indices = new_buffer<glm::uvec3>(geometry, RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, mesh.indices.size());
    device_.check("taking a mesh's buffers");
    std::ranges::copy(mesh.positions, positions);
    std::ranges::copy(mesh.indices, indices);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(bottom.scene.get(), geometry);
  }
  rtcCommitScene(bottom.scene.get());
  device_.check("building a mesh");
  meshes_.push_back(std::move(bottom));
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
  rtcCommitScene(bottom.scene.get());
  device_.check("deforming a mesh");
  bottom.refittable = true;
  bottom.refits = refit ? bottom.refits + 1 : 0;
}

bool EmbreeWorld::only_moved(const std::vector<Placement>& placements) const {
  return std::ranges::equal(placements, placements_, [](const Placement& a, const Placement& b) {
    return a.mesh == b.mesh && a.environment == b.environment && a.traceable == b.traceable;
  });
}

void EmbreeWorld::move(const std::vector<Placement>& placements, const std::vector<uint32_t>& deformed) {
  std::vector<bool> moved(placements.size());
  for (size_t i = 0; i < placements.size(); ++i) {
    if (!placements[i].traceable) continue;
    moved[i] = placements[i] != placements_[i] || std::ranges::binary_search(deformed, placements[i].mesh);
    if (moved[i]) set_transform(geometries_[i].get(), placements[i].local_to_world);
  }
  for (const Environment& environment : environments_)
    if (std::ranges::any_of(environment.instances, [&](uint32_t i) { return moved[i]; })) rtcCommitScene(environment.scene.get());
}

void EmbreeWorld::place(const std::vector<Placement>& placements, uint32_t environment_count) {
  environments_.clear();
  geometries_.clear();
  for (const Placement& p : placements) {
    EmbreeGeometry& geometry = geometries_.emplace_back();
    if (!p.traceable) continue;
    geometry.reset(rtcNewGeometry(device_.handle(), RTC_GEOMETRY_TYPE_INSTANCE));
    rtcSetGeometryInstancedScene(geometry.get(), meshes_[p.mesh].scene.get());
    set_transform(geometry.get(), p.local_to_world);
  }
  for (auto& instances : placements_by_environment(placements, environment_count)) {
    EmbreeScene scene = device_.new_scene();
    for (uint32_t i = 0; i < instances.size(); ++i) rtcAttachGeometryByID(scene.get(), geometries_[instances[i]].get(), i);
    rtcCommitScene(scene.get());
    environments_.push_back({std::move(scene), std::move(instances)});
  }
}

}  // namespace kuafu
