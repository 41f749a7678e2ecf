// SPDX-License-Identifier: Apache-2.0
// glTF materials and the textures they use, into kuafu's.
#pragma once

#include <map>
#include <utility>

#include "import/gltf_document.h"
#include "import/import.h"

namespace kuafu {

class GltfMaterials {
 public:
  GltfMaterials(Import& import, const tinygltf::Model& model) : import_(import), model_(model) {}
  /// Adds every material of the file, so that ids follow the file's order.
  void add_all();
  /// Scene id of the file's material; -1 is glTF's default material, added at first use. `field` names the user in errors.
  uint32_t id(int index, const std::string& field);

 private:
  Material read(const tinygltf::Material& from, const std::string& field);
  void read_extensions(const tinygltf::Material& from, const std::string& field, Material& to);
  void read_extras(const tinygltf::Value& extras, const std::string& field, Material& to);
  int image_of(const tinygltf::Texture& texture, int index, const std::string& field);
  void warn_of_sampler(const tinygltf::Texture& texture, const std::string& field);
  /// Scene id of a texture; index -1 = none. One image used as colour and as data becomes two textures.
  uint32_t texture(int index, int uv_set, bool srgb, const std::string& field);

  Import& import_;
  const tinygltf::Model& model_;
  std::map<std::pair<int, bool>, uint32_t> textures_;  // (image, srgb) to id
  uint32_t default_ = none;
};

}  // namespace kuafu
