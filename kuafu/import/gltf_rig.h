// SPDX-License-Identifier: Apache-2.0
// The nodes, animations and skins of a glTF file as a rig (scene/rig.h), filled while the node tree is walked.
#pragma once

#include <vector>

#include "import/gltf_document.h"
#include "import/gltf_mesh.h"
#include "scene/rig.h"

namespace kuafu {

class GltfRig {
 public:
  GltfRig(Import& import, const tinygltf::Model& model);

  /// Adds the next node of the walk; `parent`: the number of an earlier node, or none. Returns the node's number in the rig.
  uint32_t add_node(size_t file_node, uint32_t parent, const std::string& field);
  /// Whether an animation moves the node or one of its ancestors.
  [[nodiscard]] bool moves(uint32_t node) const { return moves_[node]; }
  /// The node's transform to its parent, without animation.
  [[nodiscard]] glm::dmat4 node_to_parent(uint32_t node) const { return to_parent(rig_.nodes[node], rig_.nodes[node].rest); }
  void add_member(RigMember member) { rig_.members.push_back(member); }
  /// Adds a mesh whose vertices this node's skin or targets move. `deforms`: the result of read_mesh() except its mesh.
  void add_mesh(uint32_t node, const tinygltf::Node& from, uint32_t mesh, GltfMesh&& deforms, const std::string& field);
  /// Ends the walk: deforms all meshes as they are without animation, and adds the rig to the scene if anything in it moves.
  void finish();

 private:
  uint32_t skin(int index, const std::string& field);
  void add_skins();
  void add_animation(size_t index);
  void add_channel(const tinygltf::Animation& from, const tinygltf::AnimationChannel& channel, const std::string& field, RigAnimation& to);
  [[nodiscard]] bool moves(const RigMesh& mesh) const;

  Import& import_;
  const tinygltf::Model& model_;
  Rig rig_;
  std::vector<uint32_t> number_;    // of the file's nodes here; none where no scene has it
  std::vector<bool> is_target_;     // of an animation's translation, rotation or scale; file's nodes
  std::vector<bool> moves_;         // nodes here
  std::vector<bool> weights_move_;  // nodes here
  std::vector<int> skins_;          // the file's number of each skin here
};

}  // namespace kuafu
