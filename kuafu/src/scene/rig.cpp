// SPDX-License-Identifier: Apache-2.0
#include "scene/rig.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "scene/finite.h"

namespace kuafu {
namespace {

constexpr double hidden_scale = 1e-8;  // of what has no extent

void apply(const RigChannel& channel, double time_s, NodePose& pose) {
  std::array<double, 4> v{};
  using Property = RigChannel::Property;
  if (channel.property == Property::weights) {
    std::vector<double> weights(channel.keyframes.width);
    value_at(channel.keyframes, time_s, weights);
    pose.weights.assign(weights.begin(), weights.end());
    return;
  }
  value_at(channel.keyframes, time_s, std::span(v).first(channel.keyframes.width));
  if (channel.property == Property::translation) pose.translation = {v[0], v[1], v[2]};
  if (channel.property == Property::rotation) pose.rotation = glm::dquat(v[3], v[0], v[1], v[2]);
  if (channel.property == Property::scale) pose.scale = {v[0], v[1], v[2]};
}

RigPose posed(const Rig& rig, std::vector<NodePose> nodes) {
  RigPose out{.nodes = std::move(nodes), .node_to_root = {}};
  out.node_to_root.reserve(rig.nodes.size());
  for (size_t i = 0; i < rig.nodes.size(); ++i) {
    const glm::dmat4 m = to_parent(rig.nodes[i], out.nodes[i]);
    out.node_to_root.push_back(rig.nodes[i].parent == none ? m : out.node_to_root[rig.nodes[i].parent] * m);
  }
  return out;
}

std::vector<NodePose> rest(const Rig& rig) {
  std::vector<NodePose> out;
  out.reserve(rig.nodes.size());
  for (const RigNode& node : rig.nodes) out.push_back(node.rest);
  return out;
}

void add_targets(const RigMesh& mesh, const std::vector<float>& weights, Vertices& to) {
  for (size_t t = 0; t < std::min(mesh.targets.size(), weights.size()); ++t) {
    if (weights[t] == 0.0f) continue;
    const MorphTarget& target = mesh.targets[t];
    for (size_t i = 0; i < target.positions.size(); ++i) to.positions[i] += weights[t] * target.positions[i];
    for (size_t i = 0; i < target.normals.size() && i < to.normals.size(); ++i) to.normals[i] += weights[t] * target.normals[i];
    for (size_t i = 0; i < target.tangents.size() && i < to.tangents.size(); ++i)
      to.tangents[i] += glm::vec4(weights[t] * target.tangents[i], 0.0f);
  }
}

/// -1 where it mirrors.
float side_of(const glm::mat3& m) { return glm::determinant(m) < 0.0f ? -1.0f : 1.0f; }

/// Inverse transpose, but for a positive factor; also where there is no inverse.
glm::mat3 normal_matrix(const glm::mat3& m) {
  return side_of(m) * glm::mat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
}

void bend(const RigMesh& mesh, const std::vector<glm::mat4>& joints, Vertices& v) {
  for (size_t i = 0; i < v.positions.size(); ++i) {
    glm::mat4 blend(0.0f);
    for (const SkinWeights& set : mesh.skin_weights)
      for (int k = 0; k < 4; ++k)
        if (set.weights[i][k] != 0.0f) blend += set.weights[i][k] * joints[set.joints[i][k]];
    v.positions[i] = glm::vec3(blend * glm::vec4(v.positions[i], 1.0f));
    if (!v.normals.empty()) v.normals[i] = normal_matrix(glm::mat3(blend)) * v.normals[i];
    if (!v.tangents.empty()) {
      const glm::mat3 turn(blend);
      v.tangents[i] = glm::vec4(turn * glm::vec3(v.tangents[i]), side_of(turn) * v.tangents[i].w);
    }
  }
}

}  // namespace

glm::dmat4 to_parent(const RigNode& node, const NodePose& pose) {
  glm::dmat4 m = glm::mat4_cast(pose.rotation);
  for (int axis = 0; axis < 3; ++axis) m[axis] *= pose.scale[axis];
  m[3] = glm::dvec4(pose.translation, 1.0);
  return node.matrix * m;
}

double RigAnimation::duration_s() const {
  double last = 0.0;
  for (const RigChannel& channel : channels) last = std::max(last, double{channel.keyframes.times_s.back()});
  return last;
}

RigPose rest_pose(const Rig& rig) { return posed(rig, rest(rig)); }

RigPose pose_at(const Rig& rig, uint32_t animation, double time_s) {
  std::vector<NodePose> nodes = rest(rig);
  for (size_t a = rig.animations.size(); a-- > 0;)  // the first is applied last
    if (animation == none || animation == a)
      for (const RigChannel& channel : rig.animations[a].channels) apply(channel, time_s, nodes[channel.node]);
  return posed(rig, std::move(nodes));
}

Vertices deformed(const Rig& rig, const RigMesh& mesh, const RigPose& pose) {
  Vertices out{.positions = mesh.positions, .normals = mesh.normals, .tangents = mesh.tangents};
  add_targets(mesh, pose.nodes[mesh.node].weights, out);
  if (mesh.skin != none) {
    const Skin& skin = rig.skins[mesh.skin];
    std::vector<glm::mat4> joints;
    joints.reserve(skin.joints.size());
    for (size_t j = 0; j < skin.joints.size(); ++j)
      joints.emplace_back(pose.node_to_root[skin.joints[j]] * glm::dmat4(skin.inverse_binds[j]));
    bend(mesh, joints, out);
  }
  for (size_t i = 0; i < out.normals.size(); ++i) {
    const float length = glm::length(out.normals[i]);
    out.normals[i] = length > 0.0f ? out.normals[i] / length : mesh.normals[i];
  }
  for (size_t i = 0; i < out.tangents.size(); ++i) {
    const glm::vec3 tangent(out.tangents[i]);
    const float length = glm::length(tangent);
    out.tangents[i] = length > 0.0f && std::isfinite(length) ? glm::vec4(tangent / length, out.tangents[i].w) : mesh.tangents[i];
  }
  return out;
}

std::optional<glm::dmat4> without_scale(const glm::dmat4& m) {
  const glm::dvec3 z = glm::normalize(glm::dvec3(m[2]));
  const glm::dvec3 x = glm::normalize(glm::cross(glm::dvec3(m[1]), z));
  const glm::dmat4 out(glm::dvec4(x, 0.0), glm::dvec4(glm::cross(z, x), 0.0), glm::dvec4(z, 0.0), m[3]);
  return all_finite(out) ? std::optional(out) : std::nullopt;
}

glm::dmat4 with_extent(const glm::dmat4& m) {
  for (int c = 0; c < 3; ++c)
    if (glm::length(glm::dvec3(m[c])) < hidden_scale) {
      glm::dmat4 small(hidden_scale);
      small[3] = m[3];
      return small;
    }
  return m;
}

std::optional<glm::dmat4> member_to_world(const Rig& rig, const RigMember& member, const RigPose& pose) {
  const glm::dmat4 node_to_world = rig.root_to_world * pose.node_to_root[member.node];
  if (member.kind == RigMember::Kind::instance) return with_extent(node_to_world * member.to_node);
  const std::optional<glm::dmat4> turned = without_scale(node_to_world);
  return turned ? std::optional(*turned * member.to_node) : std::nullopt;
}

}  // namespace kuafu
