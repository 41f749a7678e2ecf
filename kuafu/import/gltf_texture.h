// SPDX-License-Identifier: Apache-2.0
// glTF textures: an image with its sampler, and where a material reads it (texture coordinates, KHR_texture_transform).
#pragma once

#include <array>
#include <map>
#include <tuple>

#include "import/gltf_document.h"
#include "import/import.h"

namespace kuafu {

/// A material's reference to a texture (textureInfo, glTF 2.0 section 5.30).
struct TextureUse {
  int index = -1;  // none
  int uv_set = 0;
  std::array<float, 6> uv_transform{};  // Texture::uv_transform

  /// Makes a reference from tinygltf's TextureInfo or NormalTextureInfo.
  template <class Info>
  static TextureUse of(const Info& info, const std::string& field) {
    const auto found = info.extensions.find("KHR_texture_transform");
    return make(info.index, info.texCoord, found == info.extensions.end() ? nullptr : &found->second, field);
  }
  /// Makes a reference from a member of an extension or of extras; none if it is absent.
  static TextureUse of(const tinygltf::Value& object, const char* key, const std::string& field);

 private:
  static TextureUse make(int index, int uv_set, const tinygltf::Value* transform, const std::string& field);
};

/// Returns a number of a JSON object, or the fallback.
double number_of(const tinygltf::Value& object, const char* key, double fallback);

class GltfTextures {
 public:
  GltfTextures(Import& import, const tinygltf::Model& model) : import_(import), model_(model) {}
  /// Returns a texture's id in the scene. None for index -1, and with a warning for an image that cannot be read. An image that is used in
  /// two ways, as colour and as data or with two lookups, becomes two textures.
  uint32_t id(const TextureUse& use, bool srgb, const std::string& field);
  /// Whether any texture reads TEXCOORD_1.
  [[nodiscard]] bool uses_uv_1() const { return uses_uv_1_; }

 private:
  struct Look {
    uint32_t wrap_u, wrap_v, filter;
  };
  /// Index of a texture's image; -1 if it names none.
  [[nodiscard]] int image_of(const tinygltf::Texture& texture, int index, const std::string& field) const;
  [[nodiscard]] Look look_of(const tinygltf::Texture& texture, const std::string& field);

  Import& import_;
  const tinygltf::Model& model_;
  bool uses_uv_1_ = false;
  // (image, sampler, srgb, uv set, transform) to id.
  std::map<std::tuple<int, int, bool, int, std::array<float, 6>>, uint32_t> ids_;
};

}  // namespace kuafu
