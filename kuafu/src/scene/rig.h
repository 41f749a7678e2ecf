// SPDX-License-Identifier: Apache-2.0
// What a scene file animates: its nodes, animations, skins and morph targets (glTF 2.0 sections 3.5, 3.7 and 3.11), and what of a scene
// hangs on them. Thread rule: pure data and functions.
#pragma once

#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <string>
#include <vector>

#include "scene/keyframes.h"
#include "scene/scene.h"

namespace kuafu {

/// What animations change of a node.
struct NodePose {
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  glm::dvec3 scale{1.0};
  std::vector<float> weights;  // of the morph targets of its mesh
};

/// Coordinates in the node become its parent's by matrix * translation * rotation * scale.
struct RigNode {
  uint32_t parent = none;  // an earlier node; none: the file's root
  glm::dmat4 matrix{1.0};
  NodePose rest;  // without animation
};

glm::dmat4 to_parent(const RigNode& node, const NodePose& pose);

struct RigChannel {
  enum class Property : uint32_t { translation, rotation, scale, weights };
  uint32_t node = 0;
  Property property = Property::translation;
  Keyframes keyframes;
};

struct RigAnimation {
  std::string name;
  std::vector<RigChannel> channels;
  [[nodiscard]] double duration_s() const;  // time of the last keyframe
};

struct Skin {
  std::vector<uint32_t> joints;          // nodes
  std::vector<glm::mat4> inverse_binds;  // of each joint: from the mesh to the joint
};

/// Up to four joints of each vertex, by their number in the skin, and their weights.
struct SkinWeights {
  std::vector<glm::uvec4> joints;
  std::vector<glm::vec4> weights;
};

/// What weight 1 adds to each vertex; empty: nothing.
struct MorphTarget {
  std::vector<glm::vec3> positions, normals, tangents;
};

/// A mesh whose vertices move, as it is before they do.
struct RigMesh {
  uint32_t mesh = none;
  uint32_t node = 0;     // whose weights its targets have
  uint32_t skin = none;  // its vertices are then the file's root's, else the node's
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> tangents;
  std::vector<SkinWeights> skin_weights;
  std::vector<MorphTarget> targets;
};

/// Something that stands on a node.
struct RigMember {
  enum class Kind : uint32_t { instance, light, camera };
  Kind kind = Kind::instance;
  uint32_t id = none;
  uint32_t node = 0;
  glm::dmat4 to_node{1.0};
};

struct Rig {
  glm::dmat4 root_to_world{1.0};
  std::vector<RigNode> nodes;
  std::vector<RigAnimation> animations;
  std::vector<Skin> skins;
  std::vector<RigMesh> meshes;
  std::vector<RigMember> members;
};

/// A rig at one time.
struct RigPose {
  std::vector<NodePose> nodes;
  std::vector<glm::dmat4> node_to_root;
};
RigPose rest_pose(const Rig& rig);
/// By one of its animations; none: by all, of which the first counts where two move the same.
RigPose pose_at(const Rig& rig, uint32_t animation, double time_s);

struct Vertices {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> tangents;
};
/// Morph targets are added, then the joints' matrices blend (section 3.7.3.3). Normals turn by the blend's inverse transpose,
/// and tangents by the blend itself, so that they keep to the surface.
Vertices deformed(const Rig& rig, const RigMesh& mesh, const RigPose& pose);

/// Where a member stands in the world. Of lights and cameras the node's scale is left out; nothing where there is no rotation then. An
/// instance without extent is made so small that no ray meets it.
std::optional<glm::dmat4> member_to_world(const Rig& rig, const RigMember& member, const RigPose& pose);
std::optional<glm::dmat4> without_scale(const glm::dmat4& m);
glm::dmat4 with_extent(const glm::dmat4& m);

/// Throws KS_ERROR_INVALID_ARGUMENT unless all of it is finite, of matching sizes, and refers to what there is. Ids of the scene are not
/// looked at.
void check(const Rig& rig);

}  // namespace kuafu
