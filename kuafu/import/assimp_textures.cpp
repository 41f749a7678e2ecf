// SPDX-License-Identifier: Apache-2.0
#include "import/assimp_textures.h"

#include <assimp/ObjMaterial.h>

#include <algorithm>
#include <array>
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

/// Of an image of another size, the texel at the same place.
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

constexpr std::array read_kinds = {aiTextureType_DIFFUSE, aiTextureType_OPACITY, aiTextureType_SPECULAR,  aiTextureType_EMISSIVE,
                                   aiTextureType_HEIGHT,  aiTextureType_NORMALS, aiTextureType_METALNESS, aiTextureType_DIFFUSE_ROUGHNESS};

}  // namespace

std::optional<std::string> AssimpTextures::uri(const aiMaterial& from, aiTextureType kind, const std::string& material) {
  aiString file;
  if (from.GetTexture(kind, 0, &file) != AI_SUCCESS || file.length == 0) return std::nullopt;
  std::string uri = file.C_Str();
  if (uri[0] == '*') {
    import_.warn("material '" + material + "': embedded texture " + uri + " is ignored");
    return std::nullopt;
  }
  std::replace(uri.begin(), uri.end(), '\\', '/');
  return uri;
}

Texture AssimpTextures::image(const std::string& uri, bool srgb) const {
  return decode_image(import_.folder.read(uri), clean_name(uri), srgb, import_.budget);
}

template <class Make>
uint32_t AssimpTextures::id(const char* what, const std::string& first, const std::string& second, Make&& make) {
  const std::tuple key{std::string(what), first, second};
  const auto found = ids_.find(key);
  if (found != ids_.end()) return found->second;
  const uint32_t id = import_.scene.add_texture(make());
  ids_.emplace(key, id);
  return id;
}

void AssimpTextures::read(const aiMaterial& from, Material& to) {
  read_color(from, to);
  read_roughness(from, to);
  read_relief(from, to);
  if (const auto emission = uri(from, aiTextureType_EMISSIVE, to.name))
    to.emission_texture = id("colour", *emission, "", [&] { return image(*emission, true); });
  if (const auto specular = uri(from, aiTextureType_SPECULAR, to.name))
    to.specular_texture = id("specular", *specular, "", [&] {
      const Texture t = image(*specular, false);
      return make(t, t.name, false, import_.budget, [&](uint32_t x, uint32_t y) { return glm::vec4(1, 1, 1, grey(t, x, y)); });
    });
  for (int type = aiTextureType_NONE + 1; type <= AI_TEXTURE_TYPE_MAX; ++type) {
    const auto kind = static_cast<aiTextureType>(type);
    if (std::find(read_kinds.begin(), read_kinds.end(), kind) == read_kinds.end() && from.GetTextureCount(kind) > 0)
      import_.warn("material '" + to.name + "': its texture of kind " + aiTextureTypeToString(kind) + " is ignored");
  }
}

/// map_Kd, and map_d as its alpha.
void AssimpTextures::read_color(const aiMaterial& from, Material& to) {
  const auto color = uri(from, aiTextureType_DIFFUSE, to.name), opacity = uri(from, aiTextureType_OPACITY, to.name);
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
void AssimpTextures::read_roughness(const aiMaterial& from, Material& to) {
  const auto rough = uri(from, aiTextureType_DIFFUSE_ROUGHNESS, to.name), metal = uri(from, aiTextureType_METALNESS, to.name);
  if (!rough && !metal) return;
  // A factor that the file does not give must not hide the map.
  float value = 0.0f;
  if (rough && from.Get(AI_MATKEY_ROUGHNESS_FACTOR, value) != AI_SUCCESS) to.roughness = 1.0f;
  if (metal && from.Get(AI_MATKEY_METALLIC_FACTOR, value) != AI_SUCCESS) to.metallic = 1.0f;
  to.metallic_roughness_texture = id("roughness", rough.value_or(""), metal.value_or(""), [&] {
    const Texture r = image(rough ? *rough : *metal, false), m = metal && rough ? image(*metal, false) : r;
    return make(r, r.name, false, import_.budget, [&](uint32_t x, uint32_t y) {
      return glm::vec4(1.0f, rough ? grey(r, x, y) : 1.0f, metal ? grey_at(m, x, y, r) : 1.0f, 1.0f);
    });
  });
}

/// norm, else map_bump with its multiplier -bm.
void AssimpTextures::read_relief(const aiMaterial& from, Material& to) {
  const auto normals = uri(from, aiTextureType_NORMALS, to.name), heights = uri(from, aiTextureType_HEIGHT, to.name);
  if (normals) to.normal_texture = id("normals", *normals, "", [&] { return image(*normals, false); });
  if (normals || !heights) return;
  float multiplier = 1.0f;
  from.Get(AI_MATKEY_OBJ_BUMPMULT_HEIGHT(0), multiplier);
  if (!std::isfinite(multiplier)) multiplier = 1.0f;
  to.normal_texture = id("heights", *heights, std::to_string(multiplier), [&] {
    const Texture t = image(*heights, false);
    return is_normal_map(t) ? t : normals_of(t, multiplier, import_.budget);
  });
}

}  // namespace kuafu
