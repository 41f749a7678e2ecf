// SPDX-License-Identifier: Apache-2.0
// The animated part of a scene file: nodes, animations, skins and morph targets (glTF 2.0 sections 3.5, 3.7 and 3.11), and the scene's
// objects that hang on them. Thread rule: pure data and functions.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <glm/gtc/quaternion.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

/// One animated property over time (glTF 2.0 section 3.11 and appendix C).
struct Keyframes {
  enum class Interpolation : uint32_t { linear, step, cubic_spline };
  Interpolation interpolation = Interpolation::linear;
  bool quaternion = false;     // x y z w, interpolated along the sphere
  uint32_t width = 0;          // numbers of one value
  std::vector<float> times_s;  // ascending
  std::vector<float> values;   // a value for each time; cubic_spline: in-tangent, value, out-tangent
};

/// Computes the value, `width` numbers, at `time_s`. Before the first keyframe and after the last, theirs hold.
void value_at(const Keyframes& keyframes, double time_s, std::span<double> out);

/// The part of a node's pose that animations change.
struct NodePose {
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  glm::dvec3 scale{1.0};
  std::vector<float> weights;  // of the morph targets of its mesh
};

/// A node of a rig: matrix * translation * rotation * scale maps its coordinates to its parent's.
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

/// Up to four joints of each vertex, by number in the skin, with weights.
struct SkinWeights {
  std::vector<glm::uvec4> joints;
  std::vector<glm::vec4> weights;
};

/// The change of each vertex at weight 1; empty: no change.
struct MorphTarget {
  std::vector<glm::vec3> positions, normals, tangents;
};

/// A mesh with moving vertices, in its undeformed shape.
struct RigMesh {
  uint32_t mesh = none;
  uint32_t node = 0;     // whose weights its targets have
  uint32_t skin = none;  // its vertices are then the file's root's, else the node's
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> tangents;
  std::vector<SkinWeights> skin_weights;
  std::vector<MorphTarget> targets;
};

/// An object that is attached to a node.
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

/// A rig's pose at one time.
struct RigPose {
  std::vector<NodePose> nodes;
  std::vector<glm::dmat4> node_to_root;
};
RigPose rest_pose(const Rig& rig);
/// Poses the rig by one animation, or by all if none is given: the first counts for a node that several move.
RigPose pose_at(const Rig& rig, uint32_t animation, double time_s);

struct Vertices {
  std::vector<glm::vec3> positions, normals;
  std::vector<glm::vec4> tangents;
};
/// Deforms a mesh: adds the morph targets, then blends the joints' matrices (glTF 2.0, section 3.7.3.3). Normals turn by the blend's
/// inverse transpose and tangents by the blend, so both keep to the surface.
Vertices deformed(const Rig& rig, const RigMesh& mesh, const RigPose& pose);

/// Returns a member's transform to the world. Lights and cameras ignore the node's scale; nothing if no rotation is left. An instance
/// without extent is made so small that no ray hits it.
std::optional<glm::dmat4> member_to_world(const Rig& rig, const RigMember& member, const RigPose& pose);
std::optional<glm::dmat4> without_scale(const glm::dmat4& m);
glm::dmat4 with_extent(const glm::dmat4& m);

/// Throws KS_ERROR_INVALID_ARGUMENT unless numbers are finite, sizes match and references exist in the rig. Scene ids are not checked.
void check(const Rig& rig);

}  // namespace kuafu
