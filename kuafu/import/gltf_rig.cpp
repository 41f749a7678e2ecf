// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_rig.h"

#include <algorithm>
#include <functional>
#include <glm/gtc/type_ptr.hpp>

#include "device/error.h"
#include "import/gltf_accessor.h"

namespace kuafu {
namespace {

glm::dvec3 vector(const std::vector<double>& v, double missing) { return v.empty() ? glm::dvec3(missing) : glm::dvec3(v[0], v[1], v[2]); }

/// Coordinates in the node to those in its parent (glTF 2.0 section 3.5.3).
RigNode read_node(const tinygltf::Node& node, const std::string& field) {
  RigNode out;
  if (!node.matrix.empty()) {
    out.matrix = glm::make_mat4(node.matrix.data());
    return out;
  }
  out.rest.translation = vector(node.translation, 0.0);
  out.rest.scale = vector(node.scale, 1.0);
  if (node.rotation.empty()) return out;
  const glm::dquat q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
  if (!(glm::length(q) > 0.5)) ks::fail(KS_ERROR_FILE, "%s.rotation has length %g, must be 1", field.c_str(), glm::length(q));
  out.rest.rotation = glm::normalize(q);
  return out;
}

std::optional<RigChannel::Property> property_of(const std::string& path) {
  using Property = RigChannel::Property;
  if (path == "translation") return Property::translation;
  if (path == "rotation") return Property::rotation;
  if (path == "scale") return Property::scale;
  if (path == "weights") return Property::weights;
  return std::nullopt;
}

Keyframes::Interpolation interpolation_of(const std::string& name, const std::string& field) {
  if (name == "LINEAR") return Keyframes::Interpolation::linear;
  if (name == "STEP") return Keyframes::Interpolation::step;
  if (name == "CUBICSPLINE") return Keyframes::Interpolation::cubic_spline;
  ks::fail(KS_ERROR_FILE, "%s.interpolation is '%.20s', must be LINEAR, STEP or CUBICSPLINE", field.c_str(), clean_name(name).c_str());
}

void check_keyframes(const Keyframes& k, const std::string& field) {
  const size_t parts = k.interpolation == Keyframes::Interpolation::cubic_spline ? 3 : 1, wanted = k.times_s.size() * parts * k.width;
  if (k.times_s.empty() || k.values.size() != wanted)
    ks::fail(KS_ERROR_FILE, "%s: %zu keyframes have %zu numbers, must be %zu", field.c_str(), k.times_s.size(), k.values.size(), wanted);
  if (std::adjacent_find(k.times_s.begin(), k.times_s.end(), std::greater_equal<float>()) != k.times_s.end())
    ks::fail(KS_ERROR_FILE, "%s.input: the times of its keyframes do not ascend", field.c_str());
}

}  // namespace

GltfRig::GltfRig(Import& import, const tinygltf::Model& model)
    : import_(import), model_(model), number_(model.nodes.size(), none), is_target_(model.nodes.size(), false) {
  rig_.root_to_world = import.root_to_world;
  for (const tinygltf::Animation& animation : model.animations)
    for (const tinygltf::AnimationChannel& channel : animation.channels)
      if (channel.target_node >= 0 && static_cast<size_t>(channel.target_node) < model.nodes.size() && channel.target_path != "weights" &&
          property_of(channel.target_path))
        is_target_[static_cast<size_t>(channel.target_node)] = true;
}

uint32_t GltfRig::add_node(size_t file_node, uint32_t parent, const std::string& field) {
  import_.budget.claim(sizeof(RigNode), field);
  RigNode node = read_node(model_.nodes[file_node], field);
  node.parent = parent;
  const auto number = static_cast<uint32_t>(rig_.nodes.size());
  number_[file_node] = number;
  rig_.nodes.push_back(std::move(node));
  moves_.push_back(is_target_[file_node] || (parent != none && moves_[parent]));
  weights_move_.push_back(false);
  return number;
}

uint32_t GltfRig::skin(int index, const std::string& field) {
  if (index < 0) return none;
  if (static_cast<size_t>(index) >= model_.skins.size())
    ks::fail(KS_ERROR_FILE, "%s.skin is %d of %zu", field.c_str(), index, model_.skins.size());
  const auto found = std::find(skins_.begin(), skins_.end(), index);
  const auto number = static_cast<uint32_t>(found - skins_.begin());
  if (found == skins_.end()) skins_.push_back(index);
  return number;
}

void GltfRig::add_mesh(uint32_t node, const tinygltf::Node& from, uint32_t mesh, GltfMesh&& deforms, const std::string& field) {
  const Mesh& whole = import_.scene.meshes()[mesh];
  import_.budget.claim(whole.positions.size() * 2 * sizeof(glm::vec3) + whole.tangents.size() * sizeof(glm::vec4), field);
  RigMesh out{.mesh = mesh,
              .node = node,
              .positions = whole.positions,
              .normals = whole.normals,
              .tangents = whole.tangents,
              .skin_weights = {},
              .targets = {}};
  if (!deforms.skin_weights.empty()) out.skin = skin(from.skin, field);
  if (out.skin != none) {
    const size_t joints = model_.skins[static_cast<size_t>(from.skin)].joints.size();
    for (const SkinWeights& set : deforms.skin_weights)
      for (const glm::uvec4& j : set.joints)
        if (std::max({j.x, j.y, j.z, j.w}) >= joints)
          ks::fail(KS_ERROR_FILE, "%s: a vertex hangs on joint %u, but its skin has %zu", field.c_str(), std::max({j.x, j.y, j.z, j.w}),
                   joints);
    out.skin_weights = std::move(deforms.skin_weights);
  }
  out.targets = std::move(deforms.targets);
  const std::vector<double>& weights = from.weights.empty() ? model_.meshes[static_cast<size_t>(from.mesh)].weights : from.weights;
  std::vector<float>& to = rig_.nodes[node].rest.weights;
  to.assign(weights.begin(), weights.end());
  to.resize(out.targets.size(), 0.0f);
  rig_.meshes.push_back(std::move(out));
}

void GltfRig::add_skins() {
  for (const int index : skins_) {
    const tinygltf::Skin& from = model_.skins[static_cast<size_t>(index)];
    const std::string field = "skins[" + std::to_string(index) + "]";
    Skin to;
    for (const int joint : from.joints) {
      if (joint < 0 || static_cast<size_t>(joint) >= number_.size() || number_[static_cast<size_t>(joint)] == none)
        ks::fail(KS_ERROR_FILE, "%s.joints: node %d is not in the scene", field.c_str(), joint);
      to.joints.push_back(number_[static_cast<size_t>(joint)]);
    }
    to.inverse_binds.assign(to.joints.size(), glm::mat4(1.0f));
    if (from.inverseBindMatrices >= 0) {
      const std::vector<float> numbers = read_floats(import_.budget, model_, from.inverseBindMatrices, 16, field + ".inverseBindMatrices");
      if (numbers.size() < 16 * to.joints.size())
        ks::fail(KS_ERROR_FILE, "%s: %zu inverseBindMatrices for %zu joints", field.c_str(), numbers.size() / 16, to.joints.size());
      for (size_t j = 0; j < to.joints.size(); ++j) to.inverse_binds[j] = glm::make_mat4(&numbers[16 * j]);
    }
    rig_.skins.push_back(std::move(to));
  }
}

void GltfRig::add_channel(const tinygltf::Animation& from, const tinygltf::AnimationChannel& channel, const std::string& field,
                          RigAnimation& to) {
  const std::optional<RigChannel::Property> property = property_of(channel.target_path);
  if (!property) return import_.warn(field + ": an animation of '" + clean_name(channel.target_path) + "' is ignored");
  if (channel.target_node < 0) return;  // section 3.11: it is to be ignored
  if (static_cast<size_t>(channel.target_node) >= number_.size())
    ks::fail(KS_ERROR_FILE, "%s.target.node is %d of %zu", field.c_str(), channel.target_node, number_.size());
  if (channel.sampler < 0 || static_cast<size_t>(channel.sampler) >= from.samplers.size())
    ks::fail(KS_ERROR_FILE, "%s.sampler is %d of %zu", field.c_str(), channel.sampler, from.samplers.size());
  const uint32_t node = number_[static_cast<size_t>(channel.target_node)];
  if (node == none) return;
  const bool weights = *property == RigChannel::Property::weights, rotation = *property == RigChannel::Property::rotation;
  const size_t width = weights ? rig_.nodes[node].rest.weights.size() : rotation ? 4 : 3;
  if (width == 0) return import_.warn(field + ": the node's mesh has no morph targets");
  const tinygltf::AnimationSampler& sampler = from.samplers[static_cast<size_t>(channel.sampler)];
  const std::string user = field + ".sampler";
  Keyframes keyframes{
      .interpolation = interpolation_of(sampler.interpolation, user),
      .quaternion = rotation,
      .width = static_cast<uint32_t>(width),
      .times_s = read_floats(import_.budget, model_, sampler.input, 1, user + ".input"),
      .values = read_floats(import_.budget, model_, sampler.output, weights ? 1 : static_cast<int>(width), user + ".output")};
  check_keyframes(keyframes, user);
  if (weights) weights_move_[node] = true;
  to.channels.push_back({.node = node, .property = *property, .keyframes = std::move(keyframes)});
}

void GltfRig::add_animation(size_t index) {
  const tinygltf::Animation& from = model_.animations[index];
  RigAnimation to{.name = from.name.empty() ? "animation" + std::to_string(index) : from.name, .channels = {}};
  for (size_t c = 0; c < from.channels.size(); ++c)
    add_channel(from, from.channels[c], "animations[" + std::to_string(index) + "] '" + to.name + "' channels[" + std::to_string(c) + "]",
                to);
  if (to.channels.empty())
    import_.warn("animation '" + to.name + "' moves nothing that is rendered");
  else
    rig_.animations.push_back(std::move(to));
}

bool GltfRig::moves(const RigMesh& mesh) const {
  if (weights_move_[mesh.node]) return true;
  return mesh.skin != none && std::ranges::any_of(rig_.skins[mesh.skin].joints, [&](uint32_t joint) { return moves_[joint]; });
}

void GltfRig::finish() {
  add_skins();
  for (size_t i = 0; i < model_.animations.size(); ++i) add_animation(i);
  if (rig_.meshes.empty() && rig_.animations.empty()) return;
  check(rig_);
  const RigPose rest = rest_pose(rig_);
  for (const RigMesh& mesh : rig_.meshes) {
    Vertices vertices = deformed(rig_, mesh, rest);
    import_.scene.update_mesh_positions(mesh.mesh, std::move(vertices.positions), std::move(vertices.normals),
                                        std::move(vertices.tangents));
  }
  if (rig_.animations.empty()) return;
  std::erase_if(rig_.meshes, [&](const RigMesh& mesh) { return !moves(mesh); });
  std::erase_if(rig_.members, [&](const RigMember& member) { return !moves_[member.node]; });
  import_.scene.add_rig(std::move(rig_));
}

}  // namespace kuafu
