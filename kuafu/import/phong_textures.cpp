// SPDX-License-Identifier: Apache-2.0
#include "import/phong_textures.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "device/error.h"
#include "import/image.h"

namespace kuafu {
namespace {

/// A channel of an image as it is stored, 0..1; beyond its last channel the last one, of grey the grey.
float stored(const Texture& t, uint32_t x, uint32_t y, uint32_t channel) {
  const size_t i = (size_t{y} * t.width + x) * t.channels + std::min(channel, t.channels - 1);
  if (t.format == Texture::Format::u8) return static_cast<float>(t.texels[i]) / 255.0f;
  uint16_t value;
  std::memcpy(&value, t.texels.data() + 2 * i, 2);
  return static_cast<float>(value) / 65535.0f;
}

/// Red, green and blue without their alpha; of grey the grey.
glm::vec3 rgb(const Texture& t, uint32_t x, uint32_t y) {
  return t.channels < 3 ? glm::vec3(stored(t, x, y, 0)) : glm::vec3(stored(t, x, y, 0), stored(t, x, y, 1), stored(t, x, y, 2));
}

float grey(const Texture& t, uint32_t x, uint32_t y) {
  const glm::vec3 c = rgb(t, x, y);
  return (c.r + c.g + c.b) / 3.0f;
}

/// The texel at the same place in an image of another size.
float grey_at(const Texture& t, uint32_t x, uint32_t y, const Texture& of) {
  const auto place = [](uint32_t i, uint32_t count, uint32_t all) { return static_cast<uint32_t>(uint64_t{i} * count / all); };
  return grey(t, place(x, t.width, of.width), place(y, t.height, of.height));
}

uint8_t byte(float value) { return static_cast<uint8_t>(std::lround(std::clamp(value, 0.0f, 1.0f) * 255.0f)); }

/// A texture of the size of `like`, each texel made by texel(x, y).
template <class Texel>
Texture make(const Texture& like, const std::string& name, bool srgb, Budget& budget, Texel&& texel) {
  Texture out;
  out.name = name;
  out.srgb = srgb;
  size_texture(out, like.width, like.height, 4, Texture::Format::u8, budget);
  for (uint32_t y = 0; y < out.height; ++y)
    for (uint32_t x = 0; x < out.width; ++x) {
      const glm::vec4 value = texel(x, y);
      for (int c = 0; c < 4; ++c) out.texels[(size_t{y} * out.width + x) * 4 + static_cast<size_t>(c)] = byte(value[c]);
    }
  return out;
}

/// A relief's image with colours is a map of normals under a wrong name: exporters write those as map_bump.
bool is_normal_map(const Texture& t) {
  if (t.channels < 3) return false;
  double coloured = 0;
  for (uint32_t y = 0; y < t.height; ++y)
    for (uint32_t x = 0; x < t.width; ++x) {
      const glm::vec3 c = rgb(t, x, y);
      coloured += c.b - std::max(c.r, c.g) > 0.1f ? 1 : 0;
    }
  return coloured > 0.5 * t.width * t.height;
}

/// Normals of heights: the slope between a texel's neighbours, times the multiplier, per texel; the image repeats. x grows with u, y
/// against v.
Texture normals_of(const Texture& heights, float multiplier, Budget& budget) {
  const uint32_t w = heights.width, h = heights.height;
  return make(heights, heights.name, false, budget, [&](uint32_t x, uint32_t y) {
    const float slope_u = grey(heights, (x + 1) % w, y) - grey(heights, (x + w - 1) % w, y);
    const float slope_v = grey(heights, x, (y + 1) % h) - grey(heights, x, (y + h - 1) % h);
    const glm::vec3 n = glm::normalize(glm::vec3(-slope_u * multiplier * 0.5f, slope_v * multiplier * 0.5f, 1.0f));
    return glm::vec4(n * 0.5f + 0.5f, 1.0f);
  });
}

}  // namespace

/// A library's images lie beside it, or where the scene file is.
std::vector<uint8_t> PhongTextures::bytes_of(const PhongMaterial& from, const std::string& name) const {
  if (!from.folder.empty()) try {
      return import_.folder.read(from.folder + "/" + name);
    } catch (const ks::Error&) {
    }
  return import_.folder.read(name);
}

std::optional<std::string> PhongTextures::uri(const PhongMaterial& from, PhongMap kind) {
  const std::string& name = from.map(kind);
  if (name.empty()) return std::nullopt;
  const auto [image, is_new] = images_.try_emplace(name);
  if (is_new) try {
      image->second = decode_image(bytes_of(from, name), clean_name(name), false, import_.budget);
    } catch (const ks::Error& error) {
      import_.warn("material '" + clean_name(from.name) + "': a texture is left out: " + error.what());
    }
  return image->second ? std::optional(name) : std::nullopt;
}

Texture PhongTextures::image(const std::string& uri, bool srgb) const {
  Texture out = *images_.at(uri);
  out.srgb = srgb;
  return out;
}

template <class Make>
uint32_t PhongTextures::id(const char* what, const std::string& first, const std::string& second, Make&& make) {
  const std::tuple key{std::string(what), first, second};
  const auto found = ids_.find(key);
  if (found != ids_.end()) return found->second;
  const uint32_t id = import_.scene.add_texture(make());
  ids_.emplace(key, id);
  return id;
}

void PhongTextures::read(const PhongMaterial& from, Material& to) {
  read_color(from, to);
  read_roughness(from, to);
  read_relief(from, to);
  if (const auto emission = uri(from, PhongMap::emission))
    to.emission_texture = id("colour", *emission, "", [&] { return image(*emission, true); });
  else if (!from.map(PhongMap::emission).empty())
    to.emission = glm::vec3(0.0f);  // written to be weighed by the image
  if (const auto specular = uri(from, PhongMap::specular))
    to.specular_texture = id("specular", *specular, "", [&] {
      const Texture t = image(*specular, false);
      return make(t, t.name, false, import_.budget, [&](uint32_t x, uint32_t y) { return glm::vec4(1, 1, 1, grey(t, x, y)); });
    });
}

/// map_Kd, and map_d as its alpha.
void PhongTextures::read_color(const PhongMaterial& from, Material& to) {
  const auto color = uri(from, PhongMap::diffuse), opacity = uri(from, PhongMap::opacity);
  if (color && !opacity) to.base_color_texture = id("colour", *color, "", [&] { return image(*color, true); });
  if (!opacity) return;
  to.alpha_mode = Material::AlphaMode::blend;
  to.base_color_texture = id("colour and opacity", color.value_or(""), *opacity, [&] {
    const Texture d = image(*opacity, false), kd = color ? image(*color, true) : d;
    return make(kd, kd.name, true, import_.budget,
                [&](uint32_t x, uint32_t y) { return glm::vec4(color ? rgb(kd, x, y) : glm::vec3(1.0f), grey_at(d, x, y, kd)); });
  });
}

/// map_Pr and map_Pm as green and blue.
void PhongTextures::read_roughness(const PhongMaterial& from, Material& to) {
  const auto rough = uri(from, PhongMap::roughness), metal = uri(from, PhongMap::metallic);
  if (!rough && !metal) return;
  // A factor that the file does not give must not hide the map.
  if (rough && !from.roughness) to.roughness = 1.0f;
  if (metal && !from.metallic) to.metallic = 1.0f;
  to.metallic_roughness_texture = id("roughness", rough.value_or(""), metal.value_or(""), [&] {
    const Texture r = image(rough ? *rough : *metal, false), m = metal && rough ? image(*metal, false) : r;
    return make(r, r.name, false, import_.budget, [&](uint32_t x, uint32_t y) {
      return glm::vec4(1.0f, rough ? grey(r, x, y) : 1.0f, metal ? grey_at(m, x, y, r) : 1.0f, 1.0f);
    });
  });
}

/// norm, else map_bump with its multiplier -bm.
void PhongTextures::read_relief(const PhongMaterial& from, Material& to) {
  const auto normals = uri(from, PhongMap::normal), heights = uri(from, PhongMap::height);
  if (normals) to.normal_texture = id("normals", *normals, "", [&] { return image(*normals, false); });
  if (normals || !heights) return;
  const float multiplier = std::isfinite(from.bump) ? from.bump : 1.0f;
  to.normal_texture = id("heights", *heights, std::to_string(multiplier), [&] {
    const Texture t = image(*heights, false);
    return is_normal_map(t) ? t : normals_of(t, multiplier, import_.budget);
  });
}

}  // namespace kuafu
