// SPDX-License-Identifier: Apache-2.0
// Phong-style materials, as MTL and Collada write them, into kuafu's GGX model.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "import/import.h"

namespace kuafu {

/// The kinds of a material's images.
enum class PhongMap : size_t { diffuse, specular, emission, opacity, roughness, metallic, height, normal, count };

/// A material with the file's unchecked values.
struct PhongMaterial {
  std::string name;
  std::string folder;  // of the names of its images, relative to the scene's; empty = the same
  glm::vec3 diffuse{0.5f}, specular{0.0f}, emission{0.0f};
  float shininess = 0.0f, opacity = 1.0f, ior = 1.5f;
  int illum = 2;                                                       // MTL's model of illumination
  std::optional<float> roughness, metallic;                            // of MTL's physically based extension
  float bump = 1.0f;                                                   // multiplies the heights
  std::array<std::string, static_cast<size_t>(PhongMap::count)> maps;  // names of image files; empty = none

  std::string& map(PhongMap kind) { return maps[static_cast<size_t>(kind)]; }
  [[nodiscard]] const std::string& map(PhongMap kind) const { return maps[static_cast<size_t>(kind)]; }
};

class PhongTextures;

/// Converts a file's material. base colour = diffuse (times map_Kd); emission = Ke; ior = Ni; specular = mean of Ks, but 0 for illum 0 and
/// 1, which have no highlight. Roughness comes from the shininess: GGX alpha^2 = 2 / (Ns + 2) matches the Blinn-Phong lobe's width (Walter
/// et al. 2007, section 5.2). A PBR roughness or metallic (Pr, Pm) is kept; without one, illum 3 or 5 of black Kd and Ks above 0.5 is a
/// mirror, of base colour Ks. Transmission = 1 - d for the glass models illum 4, 6, 7 and 9,
/// which are also smooth; in other models d is alpha (KUAFU_ALPHA_BLEND). Values outside a field's range are clamped, with a warning.
Material read_material(Import& import, const PhongMaterial& from, PhongTextures& textures);

/// The material of coloured vertices in a file without materials: white and Lambertian.
Material colored_material();

/// Decodes vertex colours, clamped to 0..1, as sRGB. Files do not state the encoding; scanners and editors write sRGB.
glm::vec4 linear_color(const glm::vec4& srgb);

/// Adds the materials of a library of OBJ files (Wavefront, Advanced Visualizer manual, chapter 5, with the physically based extension Pr,
/// Pm, norm), or of several: `names` is one name with blanks, or a list. Warns of libraries that cannot be opened and
/// of statements that are not rendered. Throws KS_ERROR_FILE with library and line for an invalid number.
void read_mtl(Import& import, const std::string& names, std::map<std::string, PhongMaterial>& materials);

}  // namespace kuafu
