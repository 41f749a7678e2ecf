// SPDX-License-Identifier: Apache-2.0
// Where a primitive's vertices come from: accessors, or compressed data in their place.
#pragma once

#include <cstring>
#include <optional>
#include <vector>

#include "import/gltf_document.h"
#include "import/gltf_draco.h"
#include "import/import.h"
#include "scene/rig.h"

namespace kuafu {

template <class Vector>
std::vector<Vector> as_vectors(const std::vector<float>& values) {
  std::vector<Vector> out(values.size() / static_cast<size_t>(Vector::length()));
  if (!out.empty()) std::memcpy(static_cast<void*>(out.data()), values.data(), out.size() * sizeof(Vector));
  return out;
}

class GltfAttributes {
 public:
  GltfAttributes(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive, const std::string& field);

  [[nodiscard]] bool has(const std::string& name) const { return accessor(name) >= 0 || (draco_ && draco_->has(name)); }
  [[nodiscard]] std::vector<float> floats(const std::string& name, int components) const;
  /// Reads a vector attribute; empty if the primitive lacks it.
  template <class Vector>
  [[nodiscard]] std::vector<Vector> vectors(const std::string& name) const {
    return has(name) ? as_vectors<Vector>(floats(name, Vector::length())) : std::vector<Vector>();
  }
  /// Reads COLOR_0 as linear RGBA; empty if it is 1 everywhere and changes nothing.
  [[nodiscard]] std::vector<glm::vec4> colors() const;
  /// The primitive's mode. Compressed data always holds triangles.
  [[nodiscard]] int mode() const { return draco_ ? TINYGLTF_MODE_TRIANGLES : primitive_.mode; }
  /// Reads the vertex indices, in the order of the primitive's mode.
  [[nodiscard]] std::vector<uint32_t> indices(size_t vertex_count) const;

 private:
  [[nodiscard]] int accessor(const std::string& name) const;
  [[nodiscard]] bool is_rgb(const std::string& name) const;

  Import& import_;
  const tinygltf::Model& model_;
  const tinygltf::Primitive& primitive_;
  const std::string& field_;
  std::optional<DracoPrimitive> draco_;
};

/// Reads the tangents of `vertex_count` vertices (glTF 2.0 section 3.7.2.1). Empty if the material does not depend on them, or without
/// normals, as the file's tangents must then be ignored.
std::vector<glm::vec4> read_tangents(const GltfAttributes& attributes, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                     size_t vertex_count, const std::string& field);
/// Reads all sets of JOINTS_n and WEIGHTS_n (section 3.7.3.3); each vertex' weights sum to 1.
std::vector<SkinWeights> read_skin_weights(const GltfAttributes& attributes, size_t vertex_count, const std::string& field);
/// Reads POSITION, NORMAL and, if `tangents`, TANGENT of each morph target (section 3.7.2.2); warns of other attributes.
std::vector<MorphTarget> read_targets(Import& import, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                      size_t vertex_count, bool tangents, const std::string& field);

}  // namespace kuafu
