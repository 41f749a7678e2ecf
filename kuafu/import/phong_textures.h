// SPDX-License-Identifier: Apache-2.0
// Converts textures of Phong-style materials to kuafu's: MTL has separate images for roughness, opacity and highlights, and relief as
// heights.
#pragma once

#include <map>
#include <tuple>

#include "import/phong_material.h"

namespace kuafu {

class PhongTextures {
 public:
  explicit PhongTextures(Import& import) : import_(import) {}

  /// Sets the material's textures. An image that is missing or cannot be read is left out with a message: models are often shared without
  /// their images, and a model in its colours is better than none.
  void read(const PhongMaterial& from, Material& to);

 private:
  /// Returns the file name of an image that was read; none if there is none or it was left out.
  [[nodiscard]] std::optional<std::string> uri(const PhongMaterial& from, PhongMap kind);
  [[nodiscard]] std::vector<uint8_t> bytes_of(const PhongMaterial& from, const std::string& name) const;
  [[nodiscard]] Texture image(const std::string& uri, bool srgb) const;
  /// Returns the scene's id of a texture that `make` builds from these images; `make` is called once for them.
  template <class Make>
  uint32_t id(const char* what, const std::string& first, const std::string& second, Make&& make);
  void read_color(const PhongMaterial& from, Material& to);
  void read_roughness(const PhongMaterial& from, Material& to);
  void read_relief(const PhongMaterial& from, Material& to);

  Import& import_;
  std::map<std::string, std::optional<Texture>> images_;  // by name; none where one cannot be read
  std::map<std::tuple<std::string, std::string, std::string>, uint32_t> ids_;
};

}  // namespace kuafu
