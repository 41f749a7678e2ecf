// SPDX-License-Identifier: Apache-2.0
// A scene posed by the animations of its files: the same calls move its parts that a host would use.
#include <cmath>

#include "device/error.h"
#include "scene/rig.h"
#include "scene/scene.h"
#include "scene/validate.h"

namespace kuafu {

void Scene::add_rig(Rig rig) {
  check(rig);
  for (const RigMesh& mesh : rig.meshes)
    if (!meshes_.has(mesh.mesh) || meshes_[mesh.mesh].positions.size() != mesh.positions.size() ||
        meshes_[mesh.mesh].normals.size() != mesh.normals.size() || meshes_[mesh.mesh].tangents.size() != mesh.tangents.size())
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "an animated mesh is mesh %u, which is not there or has other vertices", mesh.mesh);
  for (const RigMember& member : rig.members) {
    const size_t count = member.kind == RigMember::Kind::instance ? instances_.ids_given()
                         : member.kind == RigMember::Kind::light  ? lights_.ids_given()
                                                                  : cameras_.size();
    if (member.id >= count)
      ks::fail(KS_ERROR_INVALID_ARGUMENT, "an animated object has the id %u, but the scene has %zu of its kind", member.id, count);
  }
  rigs_.push_back(std::make_shared<const Rig>(std::move(rig)));
}

/// Everything that poses of rigs change. All of it is gathered and checked before any of it is taken.
struct Scene::Posed {
  std::vector<std::pair<uint32_t, Vertices>> meshes;
  std::vector<uint32_t> instances, lights;
  std::vector<glm::dmat4> instance_poses;
  std::vector<Light> moved_lights;
  std::vector<std::pair<uint32_t, glm::dmat4>> camera_poses;
};

void Scene::animate(uint32_t animation, double time_s) {
  if (!std::isfinite(time_s)) ks::fail(KS_ERROR_INVALID_ARGUMENT, "time_s is %g, must be finite", time_s);
  Posed posed;
  size_t first = 0;
  bool found = animation == none;
  for (const auto& rig : rigs_) {
    const size_t count = rig->animations.size();
    if (animation == none) {
      gather(*rig, pose_at(*rig, none, time_s), posed);
    } else if (animation >= first && animation - first < count) {
      gather(*rig, pose_at(*rig, static_cast<uint32_t>(animation - first), time_s), posed);
      found = true;
    }
    first += count;
  }
  if (!found) ks::fail(KS_ERROR_INVALID_ARGUMENT, "there is no animation %u (the scene has %zu)", animation, first);
  take(std::move(posed));
}

void Scene::gather(const Rig& rig, const RigPose& pose, Posed& to) const {
  for (const RigMesh& mesh : rig.meshes) {
    if (!meshes_.has(mesh.mesh)) continue;
    to.meshes.emplace_back(mesh.mesh, deformed(rig, mesh, pose));
    const Vertices& vertices = to.meshes.back().second;
    check_vertices(meshes_[mesh.mesh].name, vertices.positions, vertices.normals);
  }
  for (const RigMember& member : rig.members) {
    const std::optional<glm::dmat4> to_world = member_to_world(rig, member, pose);
    if (!to_world) continue;
    if (member.kind == RigMember::Kind::camera) {
      check_rigid(*to_world, ("camera '" + cameras_[member.id].name + "': camera_to_world").c_str());
      to.camera_poses.emplace_back(member.id, *to_world);
    } else if (member.kind == RigMember::Kind::instance && instances_.has(member.id)) {
      to.instances.push_back(member.id);
      to.instance_poses.push_back(*to_world);
    } else if (member.kind == RigMember::Kind::light && lights_.has(member.id)) {
      to.lights.push_back(member.id);
      to.moved_lights.push_back(lights_[member.id]);
      to.moved_lights.back().light_to_world = *to_world;
      check(to.moved_lights.back());
    }
  }
}

void Scene::take(Posed&& posed) {
  set_instance_poses(posed.instances, posed.instance_poses);  // checks all of them first, and nothing else was taken yet
  for (auto& [id, vertices] : posed.meshes)
    move_vertices(id, std::move(vertices.positions), std::move(vertices.normals), std::move(vertices.tangents));
  if (!posed.lights.empty()) set_lights(posed.lights, posed.moved_lights);
  for (const auto& [id, camera_to_world] : posed.camera_poses) cameras_[id].camera_to_world = camera_to_world;
}

}  // namespace kuafu
