// SPDX-License-Identifier: Apache-2.0
#include "import/phong_material.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "device/error.h"
#include "import/phong_textures.h"

namespace kuafu {
namespace {

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

float linear(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }

/// A mirror in classical files: nothing but traced reflections, of more than any dielectric's.
bool is_mirror(const PhongMaterial& m) {
  const auto most = [](const glm::vec3& color) { return std::max({color[0], color[1], color[2]}); };
  return !m.metallic && (m.illum == 3 || m.illum == 5) && most(m.diffuse) < 0.05f && most(m.specular) > 0.5f;
}

bool is_glass(int illum) { return illum == 4 || illum == 6 || illum == 7 || illum == 9; }

}  // namespace

Material read_material(Import& import, const PhongMaterial& from, PhongTextures& textures) {
  Material to;
  to.name = clean_name(from.name);
  const Clamp clamp(import, to.name);
  constexpr float huge = std::numeric_limits<float>::max();
  const float opacity = clamp("opacity", from.opacity, 0.0f, 1.0f);
  const float shininess = clamp("shininess", from.shininess, 0.0f, huge);
  for (int i = 0; i < 3; ++i) {
    to.base_color[i] = clamp("diffuse", is_mirror(from) ? from.specular[i] : from.diffuse[i], 0.0f, 1.0f);
    to.emission[i] = clamp("emission", from.emission[i], 0.0f, huge);
  }
  to.base_color.a = is_glass(from.illum) ? 1.0f : opacity;
  const glm::vec3& specular = from.specular;
  to.specular = from.illum < 2 ? 0.0f : clamp("specular", (specular[0] + specular[1] + specular[2]) / 3.0f, 0.0f, 1.0f);
  to.ior = clamp("ior", std::max(from.ior, 1.0f), 1.0f, huge);
  const float alpha = std::sqrt(2.0f / (shininess + 2.0f));
  to.roughness = clamp("roughness", from.roughness.value_or(std::sqrt(alpha)), 0.0f, 1.0f);
  to.metallic = clamp("metallic", from.metallic.value_or(is_mirror(from) ? 1.0f : 0.0f), 0.0f, 1.0f);
  if (is_glass(from.illum)) {
    to.transmission = 1.0f - opacity;
    to.roughness = 0.0f;
    to.specular = 1.0f;
  }
  if (to.base_color.a < 1.0f) to.alpha_mode = Material::AlphaMode::blend;
  textures.read(from, to);
  return to;
}

Material colored_material() {
  Material m;
  m.name = "vertex colours";
  m.specular = 0.0f;
  return m;
}

glm::vec4 linear_color(const glm::vec4& srgb) {
  const glm::vec4 v = glm::clamp(srgb, glm::vec4(0.0f), glm::vec4(1.0f));
  return {linear(v.r), linear(v.g), linear(v.b), v.a};
}

}  // namespace kuafu
