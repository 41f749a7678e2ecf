// SPDX-License-Identifier: Apache-2.0
// A rig comes from a helper program's answer (io/wire.h), of which nothing is believed.
#include <algorithm>
#include <cmath>

#include "device/error.h"
#include "scene/finite.h"
#include "scene/rig.h"

namespace kuafu {
namespace {

void demand(bool good, const char* what, size_t index) {
  if (!good) ks::fail(KS_ERROR_INVALID_ARGUMENT, "%s %zu is not one that can be shown", what, index);
}

bool is_affine(const glm::dmat4& m) { return all_finite(m) && m[0][3] == 0.0 && m[1][3] == 0.0 && m[2][3] == 0.0 && m[3][3] == 1.0; }

bool is_good(const RigChannel& channel, const Rig& rig) {
  using Property = RigChannel::Property;
  const Keyframes& k = channel.keyframes;
  if (channel.node >= rig.nodes.size() || channel.property > Property::weights) return false;
  const size_t width = channel.property == Property::rotation  ? 4
                       : channel.property == Property::weights ? rig.nodes[channel.node].rest.weights.size()
                                                               : 3;
  const size_t parts = k.interpolation == Keyframes::Interpolation::cubic_spline ? 3 : 1;
  return k.interpolation <= Keyframes::Interpolation::cubic_spline && k.width == width && width > 0 &&
         k.quaternion == (channel.property == Property::rotation) && !k.times_s.empty() &&
         k.values.size() == k.times_s.size() * parts * width && all_finite(k.times_s) && all_finite(k.values) &&
         std::ranges::adjacent_find(k.times_s, std::greater_equal<float>()) == k.times_s.end();
}

bool is_good(const RigMesh& mesh, const Rig& rig) {
  if (mesh.node >= rig.nodes.size() || (mesh.skin != none && mesh.skin >= rig.skins.size())) return false;
  const size_t count = mesh.positions.size();
  const auto fits = [&](const auto& values) { return values.empty() || values.size() == count; };
  if (!all_finite(mesh.positions) || !all_finite(mesh.normals) || !fits(mesh.normals)) return false;
  if (!all_finite(mesh.tangents) || !fits(mesh.tangents)) return false;
  if (mesh.targets.size() != rig.nodes[mesh.node].rest.weights.size()) return false;
  for (const MorphTarget& t : mesh.targets)
    for (const std::vector<glm::vec3>* added : {&t.positions, &t.normals, &t.tangents})
      if (!fits(*added) || !all_finite(*added)) return false;
  if (mesh.skin == none) return mesh.skin_weights.empty();
  const auto joints = static_cast<uint32_t>(rig.skins[mesh.skin].joints.size());
  for (const SkinWeights& set : mesh.skin_weights) {
    if (set.joints.size() != count || set.weights.size() != count) return false;
    for (size_t i = 0; i < count; ++i)
      for (int k = 0; k < 4; ++k)
        if (set.joints[i][k] >= joints || !std::isfinite(set.weights[i][k])) return false;
  }
  return true;
}

bool is_good(const RigNode& node, size_t index) {
  const NodePose& p = node.rest;
  const double length = glm::length(p.rotation);
  return (node.parent == none || node.parent < index) && is_affine(node.matrix) && all_finite(p.translation) && all_finite(p.scale) &&
         std::abs(length - 1.0) < 1e-3 && all_finite(p.weights);
}

}  // namespace

void check(const Rig& rig) {
  demand(is_affine(rig.root_to_world), "root", 0);
  for (size_t i = 0; i < rig.nodes.size(); ++i) demand(is_good(rig.nodes[i], i), "node", i);
  for (size_t i = 0; i < rig.animations.size(); ++i) {
    demand(!rig.animations[i].channels.empty(), "animation", i);
    for (const RigChannel& channel : rig.animations[i].channels) demand(is_good(channel, rig), "a channel of animation", i);
  }
  for (size_t i = 0; i < rig.skins.size(); ++i) {
    const Skin& skin = rig.skins[i];
    demand(skin.inverse_binds.size() == skin.joints.size() && all_finite(skin.inverse_binds) &&
               std::ranges::all_of(skin.joints, [&](uint32_t node) { return node < rig.nodes.size(); }),
           "skin", i);
  }
  for (size_t i = 0; i < rig.meshes.size(); ++i) demand(is_good(rig.meshes[i], rig), "deformed mesh", i);
  for (size_t i = 0; i < rig.members.size(); ++i)
    demand(rig.members[i].node < rig.nodes.size() && rig.members[i].kind <= RigMember::Kind::camera && is_affine(rig.members[i].to_node),
           "animated object", i);
}

}  // namespace kuafu
