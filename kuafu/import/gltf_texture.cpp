// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_texture.h"

#include <cmath>

#include "device/error.h"
#include "import/gltf_accessor.h"
#include "import/image.h"
#include "kuafu/geometry.h"

namespace kuafu {
namespace {

glm::dvec2 pair_of(const tinygltf::Value& object, const char* key, const glm::dvec2& fallback, const std::string& field) {
  if (!object.IsObject() || !object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  if (!value.IsArray() || value.ArrayLen() != 2 || !value.Get(0).IsNumber() || !value.Get(1).IsNumber())
    ks::fail(KS_ERROR_FILE, "%s.extensions.KHR_texture_transform.%s must be 2 numbers", field.c_str(), key);
  return {value.Get(0).GetNumberAsDouble(), value.Get(1).GetNumberAsDouble()};
}

Texture read_image(const Import& import, const tinygltf::Model& model, int index, bool srgb, const std::string& field) {
  const tinygltf::Image& image = model.images[static_cast<size_t>(index)];
  const std::string name = !image.name.empty() ? image.name : !image.uri.empty() ? clean_name(image.uri) : "image" + std::to_string(index);
  if (image.bufferView >= 0) {
    const Bytes bytes = view_bytes(model, image.bufferView, field);
    return decode_image({bytes.data, bytes.size}, name, srgb, import.budget);
  }
  if (image.uri.empty()) return decode_image(image.image, name, srgb, import.budget);
  return decode_image(import.folder.read(decode_uri(image.uri)), name, srgb, import.budget);
}

uint32_t wrap_of(int mode, const char* which, const std::string& field) {
  if (mode == TINYGLTF_TEXTURE_WRAP_REPEAT) return KUAFU_WRAP_REPEAT;
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return KUAFU_WRAP_CLAMP;
  if (mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return KUAFU_WRAP_MIRROR;
  ks::fail(KS_ERROR_FILE, "%s: its sampler's %s is %d, must be 10497 (repeat), 33071 (clamp) or 33648 (mirror)", field.c_str(), which,
           mode);
}

}  // namespace

double number_of(const tinygltf::Value& object, const char* key, double fallback) {
  if (!object.IsObject() || !object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  return value.IsNumber() ? value.GetNumberAsDouble() : fallback;
}

TextureUse TextureUse::of(const tinygltf::Value& object, const char* key, const std::string& field) {
  if (!object.IsObject() || !object.Has(key)) return {};
  const tinygltf::Value& info = object.Get(key);
  const tinygltf::Value* transform = nullptr;
  if (info.IsObject() && info.Has("extensions") && info.Get("extensions").Has("KHR_texture_transform"))
    transform = &info.Get("extensions").Get("KHR_texture_transform");
  return make(static_cast<int>(number_of(info, "index", -1.0)), static_cast<int>(number_of(info, "texCoord", 0.0)), transform, field);
}

// Offset after rotation after scale. The rotation is counter-clockwise in the image, whose v points down (the extension's text; its sample
// code turns the other way, Khronos' sample viewer and three.js turn as this does).
TextureUse TextureUse::make(int index, int uv_set, const tinygltf::Value* transform, const std::string& field) {
  TextureUse use;
  use.index = index;
  use.uv_set = uv_set;
  if (transform == nullptr) return use;
  use.uv_set = static_cast<int>(number_of(*transform, "texCoord", uv_set));
  const glm::dvec2 offset = pair_of(*transform, "offset", {0, 0}, field), scale = pair_of(*transform, "scale", {1, 1}, field);
  const double turn = number_of(*transform, "rotation", 0.0), c = std::cos(turn), s = std::sin(turn);
  const std::array<double, 6> m{c * scale.x, s * scale.y, offset.x, -s * scale.x, c * scale.y, offset.y};
  if (m != std::array<double, 6>{1, 0, 0, 0, 1, 0})
    for (size_t i = 0; i < m.size(); ++i) use.uv_transform[i] = static_cast<float>(m[i]);
  return use;
}

int GltfTextures::image_of(const tinygltf::Texture& texture, int index, const std::string& field) const {
  int image = texture.source;
  // A format that is read comes first; else what stands in for it.
  for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"}) {
    const auto extension = texture.extensions.find(name);
    if (extension == texture.extensions.end()) continue;
    const bool read = std::string(name) == "EXT_texture_webp";
    if (read) image = static_cast<int>(number_of(extension->second, "source", image));
    if (!read && image < 0)
      ks::fail(KS_ERROR_UNSUPPORTED, "%s: textures[%d] is there as %s alone, which is not read: export it as PNG, JPEG or WebP too",
               field.c_str(), index, name);
    if (!read) import_.warn(field + ": its " + name + " image is ignored, and the one that stands in for it is read");
  }
  if (image < -1 || (image >= 0 && static_cast<size_t>(image) >= model_.images.size()))
    ks::fail(KS_ERROR_FILE, "%s: textures[%d].source is image %d of %zu", field.c_str(), index, image, model_.images.size());
  return image;
}

GltfTextures::Look GltfTextures::look_of(const tinygltf::Texture& texture, const std::string& field) {
  if (texture.sampler < 0) return {KUAFU_WRAP_REPEAT, KUAFU_WRAP_REPEAT, KUAFU_FILTER_LINEAR};
  if (static_cast<size_t>(texture.sampler) >= model_.samplers.size())
    ks::fail(KS_ERROR_FILE, "%s: sampler %d of %zu", field.c_str(), texture.sampler, model_.samplers.size());
  const tinygltf::Sampler& sampler = model_.samplers[static_cast<size_t>(texture.sampler)];
  const bool nearest = sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST;
  return {wrap_of(sampler.wrapS, "wrapS", field), wrap_of(sampler.wrapT, "wrapT", field),
          nearest ? KUAFU_FILTER_NEAREST : KUAFU_FILTER_LINEAR};
}

uint32_t GltfTextures::id(const TextureUse& use, bool srgb, const std::string& field) {
  if (use.index < 0) return none;
  if (static_cast<size_t>(use.index) >= model_.textures.size())
    ks::fail(KS_ERROR_FILE, "%s: texture %d of %zu", field.c_str(), use.index, model_.textures.size());
  int uv_set = use.uv_set;
  if (uv_set < 0 || uv_set > 1) {
    import_.warn(field + ": TEXCOORD_" + std::to_string(uv_set) + " is not read, TEXCOORD_0 is used");
    uv_set = 0;
  }
  const tinygltf::Texture& texture = model_.textures[static_cast<size_t>(use.index)];
  const int image = image_of(texture, use.index, field);
  if (image < 0) {
    import_.warn(field + " is left out: textures[" + std::to_string(use.index) + "] has no source");
    return none;
  }
  const Look look = look_of(texture, field);
  const std::tuple key{image, texture.sampler, srgb, uv_set, use.uv_transform};
  const auto found = ids_.find(key);
  if (found != ids_.end()) return found->second;
  Texture out;
  try {
    out = read_image(import_, model_, image, srgb, field);
  } catch (const ks::Error& error) {
    import_.warn(field + " is left out: " + error.what());
    ids_.emplace(key, none);
    return none;
  }
  out.wrap_u = look.wrap_u;
  out.wrap_v = look.wrap_v;
  out.filter = look.filter;
  out.uv_set = static_cast<uint32_t>(uv_set);
  out.uv_transform = use.uv_transform;
  uses_uv_1_ = uses_uv_1_ || uv_set == 1;
  const uint32_t id = import_.scene.add_texture(std::move(out));
  ids_.emplace(key, id);
  return id;
}

}  // namespace kuafu
