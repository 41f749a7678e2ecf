// SPDX-License-Identifier: Apache-2.0
// A scene posed by the animations of its files: the same calls move its parts that a host would use.
#include <cmath>

#include "device/error.h"
#include "scene/rig.h"
#include "scene/scene.h"

namespace kuafu {
namespace {

template <class T>
bool is_live(const std::vector<std::optional<T>>& table, uint32_t id) {
  return table[id].has_value();
}

}  // namespace

void Scene::add_rig(Rig rig) {
  check(rig);
  for (const RigMesh& mesh : rig.meshes)
    if (mesh.mesh >= meshes_.size() || meshes_[mesh.mesh].positions.size() != mesh.positions.size() ||
        meshes_[mesh.mesh].normals.size() != mesh.normals.size())
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "an animated mesh is mesh %u, which is not there or has other vertices", mesh.mesh);
  for (const RigMember& member : rig.members) {
    const size_t count = member.kind == RigMember::Kind::instance ? instances_.size()
                         : member.kind == RigMember::Kind::light  ? lights_.size()
                                                                  : cameras_.size();
    if (member.id >= count)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "an animated object has the id %u, but the scene has %zu of its kind", member.id, count);
  }
  rigs_.push_back(std::make_shared<const Rig>(std::move(rig)));
}

void Scene::animate(uint32_t animation, double time_s) {
  if (!std::isfinite(time_s)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "time_s is %g, must be finite", time_s);
  size_t first = 0;
  for (const auto& rig : rigs_) {
    const size_t count = rig->animations.size();
    if (animation == none)
      pose(*rig, none, time_s);
    else if (animation >= first && animation - first < count)
      return pose(*rig, static_cast<uint32_t>(animation - first), time_s);
    first += count;
  }
  if (animation != none) ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no animation %u (the scene has %zu)", animation, first);
}

void Scene::pose(const Rig& rig, uint32_t animation, double time_s) {
  const RigPose pose = pose_at(rig, animation, time_s);
  for (const RigMesh& mesh : rig.meshes) {
    if (meshes_[mesh.mesh].removed) continue;
    Vertices vertices = deformed(rig, mesh, pose);
    update_mesh_positions(mesh.mesh, std::move(vertices.positions), std::move(vertices.normals));
  }
  std::vector<uint32_t> instances, lights;
  std::vector<glm::dmat4> poses;
  std::vector<Light> moved;
  for (const RigMember& member : rig.members) {
    const std::optional<glm::dmat4> to_world = member_to_world(rig, member, pose);
    if (!to_world) continue;
    if (member.kind == RigMember::Kind::camera) {
      cameras_[member.id].camera_to_world = *to_world;
    } else if (member.kind == RigMember::Kind::instance && is_live(instances_, member.id)) {
      instances.push_back(member.id);
      poses.push_back(*to_world);
    } else if (member.kind == RigMember::Kind::light && is_live(lights_, member.id)) {
      lights.push_back(member.id);
      moved.push_back(*lights_[member.id]);
      moved.back().light_to_world = *to_world;
    }
  }
  set_instance_poses(instances, poses);
  if (!lights.empty()) set_lights(lights, moved);
}

}  // namespace kuafu
