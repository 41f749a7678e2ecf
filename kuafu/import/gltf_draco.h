// SPDX-License-Identifier: Apache-2.0
// KHR_draco_mesh_compression: a primitive whose triangles and attributes libdraco decodes.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "import/gltf_document.h"

namespace draco {
class Mesh;
}

namespace kuafu {

class DracoPrimitive {
 public:
  /// Decodes a compressed primitive; nothing if it is not compressed. Throws KS_ERROR_FILE with `field`.
  static std::optional<DracoPrimitive> decode(Budget& budget, const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                              const std::string& field);
  ~DracoPrimitive();
  DracoPrimitive(DracoPrimitive&&) noexcept;
  DracoPrimitive& operator=(DracoPrimitive&&) noexcept;

  [[nodiscard]] bool has(const std::string& attribute) const;
  /// An attribute's values, [vertices][components], as read_floats() returns them (gltf_accessor.h).
  [[nodiscard]] std::vector<float> floats(const std::string& attribute, int components, const std::string& field) const;
  [[nodiscard]] int components(const std::string& attribute) const;
  /// Vertex indices, three per triangle.
  [[nodiscard]] std::vector<uint32_t> indices() const;

 private:
  DracoPrimitive(std::unique_ptr<draco::Mesh> mesh, const tinygltf::Value& attributes);
  std::unique_ptr<draco::Mesh> mesh_;
  tinygltf::Value attributes_;  // name to Draco's unique id
};

}  // namespace kuafu
