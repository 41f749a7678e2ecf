// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_material.h"

#include <assimp/ObjMaterial.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "device/error.h"

namespace kuafu {
namespace {

std::optional<glm::vec3> colour(const aiMaterial& from, const char* key, unsigned type, unsigned index) {
  aiColor3D c;
  if (from.Get(key, type, index, c) != AI_SUCCESS) return std::nullopt;
  return glm::vec3(c.r, c.g, c.b);
}

std::optional<float> number(const aiMaterial& from, const char* key, unsigned type, unsigned index) {
  float value = 0.0f;
  if (from.Get(key, type, index, value) != AI_SUCCESS) return std::nullopt;
  return value;
}

class Clamp {
 public:
  Clamp(Import& import, const std::string& name) : import_(import), name_(name) {}
  float operator()(const char* field, float value, float low, float high) const {
    if (!std::isfinite(value)) ks::fail(KS_ERROR_FILE, "material '%s': %s is not finite", name_.c_str(), field);
    const float inside = std::clamp(value, low, high);
    if (inside != value)
      import_.warn("material '" + name_ + "': " + field + " " + std::to_string(value) + " is clamped to " + std::to_string(inside));
    return inside;
  }

 private:
  Import& import_;
  const std::string& name_;
};

bool is_glass(int illum) { return illum == 4 || illum == 6 || illum == 7 || illum == 9; }

}  // namespace

Material read_material(Import& import, const aiMaterial& from, AssimpTextures& textures) {
  aiString name;
  from.Get(AI_MATKEY_NAME, name);
  Material to;
  to.name = clean_name(name.C_Str());
  const Clamp clamp(import, to.name);
  constexpr float huge = std::numeric_limits<float>::max();
  const int illum = static_cast<int>(number(from, AI_MATKEY_OBJ_ILLUM).value_or(2.0f));
  const float opacity = clamp("opacity", number(from, AI_MATKEY_OPACITY).value_or(1.0f), 0.0f, 1.0f);
  const glm::vec3 diffuse = colour(from, AI_MATKEY_COLOR_DIFFUSE).value_or(glm::vec3(0.5f));
  const glm::vec3 specular = colour(from, AI_MATKEY_COLOR_SPECULAR).value_or(glm::vec3(0.0f));
  const glm::vec3 emission = colour(from, AI_MATKEY_COLOR_EMISSIVE).value_or(glm::vec3(0.0f));
  const float shininess = clamp("shininess", number(from, AI_MATKEY_SHININESS).value_or(0.0f), 0.0f, huge);
  for (int i = 0; i < 3; ++i) {
    to.base_color[i] = clamp("diffuse", diffuse[i], 0.0f, 1.0f);
    to.emission[i] = clamp("emission", emission[i], 0.0f, huge);
  }
  to.base_color.a = is_glass(illum) ? 1.0f : opacity;
  to.specular = illum < 2 ? 0.0f : clamp("specular", (specular[0] + specular[1] + specular[2]) / 3.0f, 0.0f, 1.0f);
  to.ior = clamp("ior", std::max(number(from, AI_MATKEY_REFRACTI).value_or(1.5f), 1.0f), 1.0f, huge);
  const float alpha = std::sqrt(2.0f / (shininess + 2.0f));
  to.roughness = clamp("roughness", number(from, AI_MATKEY_ROUGHNESS_FACTOR).value_or(std::sqrt(alpha)), 0.0f, 1.0f);
  to.metallic = clamp("metallic", number(from, AI_MATKEY_METALLIC_FACTOR).value_or(0.0f), 0.0f, 1.0f);
  if (is_glass(illum)) {
    to.transmission = 1.0f - opacity;
    to.roughness = 0.0f;
    to.specular = 1.0f;
  }
  if (to.base_color.a < 1.0f) to.alpha_mode = Material::AlphaMode::blend;
  textures.read(from, to);
  return to;
}

}  // namespace kuafu
