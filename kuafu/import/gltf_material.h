// SPDX-License-Identifier: Apache-2.0
// glTF materials and the textures they use, into kuafu's.
#pragma once

#include "import/gltf_texture.h"

namespace kuafu {

class GltfMaterials {
 public:
  GltfMaterials(Import& import, const tinygltf::Model& model) : import_(import), model_(model), textures_(import, model) {}
  /// Adds every material of the file, so that ids follow the file's order.
  void add_all();
  /// Returns a material's id in the scene; -1 is glTF's default material, added at first use. `field` names the user in errors.
  uint32_t id(int index, const std::string& field);
  /// Whether any material reads TEXCOORD_1.
  [[nodiscard]] bool uses_uv_1() const { return textures_.uses_uv_1(); }

 private:
  Material read(const tinygltf::Material& from, const std::string& field);
  void read_extensions(const tinygltf::Material& from, const std::string& field, Material& to);
  void read_specular_color(const tinygltf::Value& extension, const std::string& field, Material& to);
  void read_unlit(const std::string& field, Material& to);
  /// Reads lobes beyond glTF's core: clearcoat, diffuse_transmission, anisotropy, sheen, iridescence, dispersion.
  void read_lobes(const tinygltf::Material& from, const std::string& field, Material& to);
  void read_extras(const tinygltf::Value& extras, const std::string& field, Material& to);

  Import& import_;
  const tinygltf::Model& model_;
  GltfTextures textures_;
  uint32_t default_ = none;
};

}  // namespace kuafu
