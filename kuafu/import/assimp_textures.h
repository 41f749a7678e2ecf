// SPDX-License-Identifier: Apache-2.0
// Textures of the formats that assimp reads, brought to what kuafu's materials have: MTL keeps roughness, opacity and highlights in images
// of their own, and relief in heights.
#pragma once

#include <assimp/material.h>

#include <map>
#include <optional>
#include <string>
#include <tuple>

#include "import/import.h"

namespace kuafu {

class AssimpTextures {
 public:
  explicit AssimpTextures(Import& import) : import_(import) {}

  /// Sets the material's textures. Throws KS_ERROR_FILE for an image that is missing or broken; warns of kinds that are not read.
  void read(const aiMaterial& from, Material& to);

 private:
  /// The image of this kind, or none.
  [[nodiscard]] std::optional<std::string> uri(const aiMaterial& from, aiTextureType kind, const std::string& material);
  [[nodiscard]] Texture image(const std::string& uri, bool srgb) const;
  /// Scene id of a texture made of these images by `make`, which is called once for them.
  template <class Make>
  uint32_t id(const char* what, const std::string& first, const std::string& second, Make&& make);
  void read_color(const aiMaterial& from, Material& to);
  void read_roughness(const aiMaterial& from, Material& to);
  void read_relief(const aiMaterial& from, Material& to);

  Import& import_;
  std::map<std::tuple<std::string, std::string, std::string>, uint32_t> ids_;
};

}  // namespace kuafu
