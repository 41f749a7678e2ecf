// SPDX-License-Identifier: Apache-2.0
#include "io/load.h"

#include <algorithm>
#include <cstring>

namespace kuafu {
namespace {

template <class T>
double largest_alpha(const Texture& texture, double full) {
  T most{};
  for (size_t at = (texture.channels - 1) * sizeof(T); at < texture.texels.size(); at += texture.channels * sizeof(T)) {
    T alpha{};
    std::memcpy(&alpha, texture.texels.data() + at, sizeof alpha);
    most = std::max(most, alpha);
  }
  return static_cast<double>(most) / full;
}

double largest_alpha(const Texture& texture) {
  if (texture.channels != 2 && texture.channels != 4) return 1.0;
  switch (texture.format) {
    case Texture::Format::u8:
      return largest_alpha<uint8_t>(texture, 255.0);
    case Texture::Format::u16:
      return largest_alpha<uint16_t>(texture, 65535.0);
    case Texture::Format::f32:
      return largest_alpha<float>(texture, 1.0);
  }
  return 1.0;
}

bool has_area(const Mesh& mesh) {
  return std::ranges::any_of(mesh.indices, [&](const glm::uvec3& t) {
    const glm::dvec3 a = mesh.positions[t.x], b = mesh.positions[t.y], c = mesh.positions[t.z];
    return glm::cross(b - a, c - a) != glm::dvec3(0.0);
  });
}

bool shows(const Material& m, double alpha) { return m.alpha_mode == Material::AlphaMode::mask ? alpha >= m.alpha_cutoff : alpha > 0.0; }

}  // namespace

std::vector<std::string> show_transparent(Scene& scene, bool keep) {
  std::vector<std::string> messages;
  for (uint32_t id = 0; id < scene.materials().size(); ++id) {
    Material m = scene.materials()[id];
    if (m.alpha_mode == Material::AlphaMode::opaque) continue;
    const bool textured = m.base_color_texture != none;
    const double of_texture = textured ? largest_alpha(scene.textures()[m.base_color_texture]) : 1.0;
    if (shows(m, m.base_color.a * of_texture)) continue;
    std::string text = "material '" + m.name + "' has opacity 0";
    if (keep) {
      messages.push_back(text + ": nothing of it is seen");
      continue;
    }
    m.base_color.a = 1.0f;
    if (!shows(m, of_texture) || !textured) m.alpha_mode = Material::AlphaMode::opaque;
    scene.set_material(id, m);
    messages.push_back(text + ", as exporters write by mistake: it is drawn opaque (--keep-transparent, or KUAFU_LOAD_TRANSPARENT=1)");
  }
  return messages;
}

std::vector<std::string> without_area(const Scene& scene) {
  std::vector<std::string> messages;
  if (!scene.rigs().empty()) return messages;  // what moves may open
  for (const auto& mesh : scene.meshes())
    if (!has_area(*mesh)) messages.push_back("mesh '" + mesh->name + "' has no area: nothing of it is seen");
  return messages;
}

}  // namespace kuafu
