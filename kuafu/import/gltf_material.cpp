// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_material.h"

#include "device/error.h"
#include "import/gltf_accessor.h"
#include "import/image.h"
#include "import/material_extras.h"

namespace kuafu {
namespace {

double number(const tinygltf::Value& object, const char* key, double fallback) {
  if (!object.IsObject() || !object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  return value.IsNumber() ? value.GetNumberAsDouble() : fallback;
}

/// {index, texCoord} of a texture reference inside an extension; index -1 where absent.
std::pair<int, int> reference(const tinygltf::Value& object, const char* key) {
  if (!object.IsObject() || !object.Has(key)) return {-1, 0};
  const tinygltf::Value& info = object.Get(key);
  return {static_cast<int>(number(info, "index", -1.0)), static_cast<int>(number(info, "texCoord", 0.0))};
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

}  // namespace

void GltfMaterials::add_all() {
  for (size_t i = 0; i < model_.materials.size(); ++i) {
    const tinygltf::Material& from = model_.materials[i];
    import_.scene.add_material(read(from, "materials[" + std::to_string(i) + "] '" + from.name + "'"));
  }
}

uint32_t GltfMaterials::id(int index, const std::string& field) {
  if (index >= 0 && static_cast<size_t>(index) >= model_.materials.size())
    ks::fail(KS_ERROR_FILE, "%s: material %d of %zu", field.c_str(), index, model_.materials.size());
  if (index >= 0) return static_cast<uint32_t>(index);
  if (default_ == none) {
    tinygltf::Material standard;
    standard.name = "glTF default";
    standard.emissiveFactor = {0.0, 0.0, 0.0};
    default_ = import_.scene.add_material(read(standard, "the default material"));
  }
  return default_;
}

Material GltfMaterials::read(const tinygltf::Material& from, const std::string& field) {
  const tinygltf::PbrMetallicRoughness& pbr = from.pbrMetallicRoughness;
  Material to;
  to.name = from.name;
  for (int i = 0; i < 4; ++i) to.base_color[i] = static_cast<float>(pbr.baseColorFactor[static_cast<size_t>(i)]);
  for (int i = 0; i < 3; ++i) to.emission[i] = static_cast<float>(from.emissiveFactor[static_cast<size_t>(i)]);
  to.metallic = static_cast<float>(pbr.metallicFactor);
  to.roughness = static_cast<float>(pbr.roughnessFactor);
  to.base_color_texture = texture(pbr.baseColorTexture.index, pbr.baseColorTexture.texCoord, true, field + ".baseColorTexture");
  to.metallic_roughness_texture =
      texture(pbr.metallicRoughnessTexture.index, pbr.metallicRoughnessTexture.texCoord, false, field + ".metallicRoughnessTexture");
  to.normal_texture = texture(from.normalTexture.index, from.normalTexture.texCoord, false, field + ".normalTexture");
  to.emission_texture = texture(from.emissiveTexture.index, from.emissiveTexture.texCoord, true, field + ".emissiveTexture");
  read_extensions(from, field, to);
  read_extras(from.extras, field, to);
  if (from.alphaMode != "OPAQUE") import_.warn(field + ".alphaMode " + from.alphaMode + " is rendered as OPAQUE");
  if (from.normalTexture.scale != 1.0) import_.warn(field + ".normalTexture.scale is ignored");
  return to;
}

// What glTF has no words for: fields of kuafu_material_desc by their names.
void GltfMaterials::read_extras(const tinygltf::Value& extras, const std::string& field, Material& to) {
  for (const auto& [name, value] : extras_numbers(to)) *value = static_cast<float>(number(extras, name, *value));
  for (const auto& [name, value] : extras_flags(to))
    if (extras.IsObject() && extras.Has(name)) *value = number(extras, name, 0.0) != 0.0;
  for (const auto& [name, value] : extras_vectors(to))
    if (extras.IsObject() && extras.Has(name))
      for (int i = 0; i < 3; ++i) (*value)[i] = static_cast<float>(extras.Get(name).Get(i).GetNumberAsDouble());
  for (const auto& [name, id] : extras_textures(to)) {
    const auto [index, uv_set] = reference(extras, name);
    *id = texture(index, uv_set, false, field + ".extras." + name);
  }
}

void GltfMaterials::read_extensions(const tinygltf::Material& from, const std::string& field, Material& to) {
  const auto extension = [&](const char* name) -> const tinygltf::Value* {
    const auto found = from.extensions.find(name);
    return found == from.extensions.end() ? nullptr : &found->second;
  };
  if (const auto* e = extension("KHR_materials_ior")) {
    // ior 0 means total reflection for every angle (KHR_materials_ior, "Interaction with other extensions"): the limit of a huge index.
    const double ior = number(*e, "ior", 1.5);
    to.ior = ior == 0.0 ? 1e6f : static_cast<float>(ior);
  }
  if (const auto* e = extension("KHR_materials_transmission")) {
    to.transmission = static_cast<float>(number(*e, "transmissionFactor", 0.0));
    const auto [index, uv_set] = reference(*e, "transmissionTexture");
    to.transmission_texture = texture(index, uv_set, false, field + ".transmissionTexture");
  }
  if (const auto* e = extension("KHR_materials_specular")) {
    to.specular = static_cast<float>(number(*e, "specularFactor", 1.0));
    const auto [index, uv_set] = reference(*e, "specularTexture");
    to.specular_texture = texture(index, uv_set, false, field + ".specularTexture");
    if (e->Has("specularColorFactor") || e->Has("specularColorTexture"))
      import_.warn(field + ": specularColorFactor and specularColorTexture are ignored");
  }
  to.transmission_roughness = to.roughness;
  const auto* volume = extension("KHR_materials_volume");
  const double thickness = volume == nullptr ? 0.0 : number(*volume, "thicknessFactor", 0.0);
  to.thin_walled = extension("KHR_materials_transmission") != nullptr && thickness == 0.0;  // as KHR_materials_volume has it
  if (to.thin_walled && volume != nullptr && volume->Has("attenuationDistance"))
    import_.warn(field + ": attenuationDistance is not used, for thicknessFactor is 0: the glass is a sheet");
  if (const auto* e = volume) {
    to.attenuation_distance_m = static_cast<float>(number(*e, "attenuationDistance", 0.0));
    if (e->Has("attenuationColor"))
      for (int i = 0; i < 3; ++i) to.attenuation_color[i] = static_cast<float>(e->Get("attenuationColor").Get(i).GetNumberAsDouble());
  }
  if (const auto* e = extension("KHR_materials_emissive_strength")) to.emission *= static_cast<float>(number(*e, "emissiveStrength", 1.0));
}

int GltfMaterials::image_of(const tinygltf::Texture& texture, int index, const std::string& field) {
  int image = texture.source;
  // A format that is read comes first; else what stands in for it.
  for (const char* name : {"EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds"}) {
    const auto extension = texture.extensions.find(name);
    if (extension == texture.extensions.end()) continue;
    const bool read = std::string(name) == "EXT_texture_webp";
    if (read) image = static_cast<int>(number(extension->second, "source", image));
    if (!read && image < 0)
      ks::fail(KS_ERROR_UNSUPPORTED, "%s: textures[%d] is there as %s alone, which is not read: export it as PNG, JPEG or WebP too",
               field.c_str(), index, name);
    if (!read) import_.warn(field + ": its " + name + " image is ignored, and the one that stands in for it is read");
  }
  if (image < 0 || static_cast<size_t>(image) >= model_.images.size())
    ks::fail(KS_ERROR_FILE, "%s: textures[%d].source is image %d of %zu", field.c_str(), index, image, model_.images.size());
  return image;
}

/// Textures repeat and are interpolated: what else a sampler asks for is said.
void GltfMaterials::warn_of_sampler(const tinygltf::Texture& texture, const std::string& field) {
  if (texture.sampler < 0) return;
  if (static_cast<size_t>(texture.sampler) >= model_.samplers.size())
    ks::fail(KS_ERROR_FILE, "%s: sampler %d of %zu", field.c_str(), texture.sampler, model_.samplers.size());
  const tinygltf::Sampler& sampler = model_.samplers[static_cast<size_t>(texture.sampler)];
  if (sampler.wrapS != TINYGLTF_TEXTURE_WRAP_REPEAT || sampler.wrapT != TINYGLTF_TEXTURE_WRAP_REPEAT)
    import_.warn(field + ": its sampler clamps or mirrors, which is ignored: the image repeats");
  if (sampler.magFilter == TINYGLTF_TEXTURE_FILTER_NEAREST)
    import_.warn(field + ": its sampler's nearest filter is ignored: texels are interpolated");
}

uint32_t GltfMaterials::texture(int index, int uv_set, bool srgb, const std::string& field) {
  if (index < 0) return none;
  if (static_cast<size_t>(index) >= model_.textures.size())
    ks::fail(KS_ERROR_FILE, "%s: texture %d of %zu", field.c_str(), index, model_.textures.size());
  if (uv_set != 0) import_.warn(field + ": TEXCOORD_" + std::to_string(uv_set) + " is not read, TEXCOORD_0 is used");
  warn_of_sampler(model_.textures[static_cast<size_t>(index)], field);
  const int image = image_of(model_.textures[static_cast<size_t>(index)], index, field);
  const auto found = textures_.find({image, srgb});
  if (found != textures_.end()) return found->second;
  const uint32_t id = import_.scene.add_texture(read_image(import_, model_, image, srgb, field));
  textures_.emplace(std::pair{image, srgb}, id);
  return id;
}

}  // namespace kuafu
