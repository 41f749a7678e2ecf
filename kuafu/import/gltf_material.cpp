// SPDX-License-Identifier: Apache-2.0
#include "import/gltf_material.h"

#include <algorithm>

#include "device/error.h"
#include "import/material_extras.h"

namespace kuafu {
namespace {

Material::AlphaMode alpha_mode(const std::string& word, const std::string& field) {
  if (word == "MASK") return Material::AlphaMode::mask;
  if (word == "BLEND") return Material::AlphaMode::blend;
  if (word != "OPAQUE") ks::fail(KS_ERROR_FILE, "%s.alphaMode is '%.20s', must be OPAQUE, MASK or BLEND", field.c_str(), word.c_str());
  return Material::AlphaMode::opaque;
}

/// nullptr: the material does not have it.
const tinygltf::Value* extension_of(const tinygltf::Material& from, const char* name) {
  const auto found = from.extensions.find(name);
  return found == from.extensions.end() ? nullptr : &found->second;
}

/// Keeps the value where the member is absent.
void read_color(const tinygltf::Value& object, const char* name, glm::vec3& to) {
  if (!object.Has(name)) return;
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(object.Get(name).Get(i).GetNumberAsDouble());
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
  const auto texture = [&](const auto& info, bool srgb, const char* name) {
    return textures_.id(TextureUse::of(info, field + "." + name), srgb, field + "." + name);
  };
  to.base_color_texture = texture(pbr.baseColorTexture, true, "baseColorTexture");
  to.metallic_roughness_texture = texture(pbr.metallicRoughnessTexture, false, "metallicRoughnessTexture");
  to.normal_texture = texture(from.normalTexture, false, "normalTexture");
  to.normal_scale = static_cast<float>(from.normalTexture.scale);
  to.emission_texture = texture(from.emissiveTexture, true, "emissiveTexture");
  // Factors that are only written to be weighed by a texture say nothing without it.
  if (pbr.metallicRoughnessTexture.index >= 0 && to.metallic_roughness_texture == none) to.metallic = 0.0f;
  if (from.emissiveTexture.index >= 0 && to.emission_texture == none) to.emission = glm::vec3(0.0f);
  to.alpha_mode = alpha_mode(from.alphaMode, field);
  to.alpha_cutoff = static_cast<float>(from.alphaCutoff);
  read_extensions(from, field, to);
  read_extras(from.extras, field, to);
  return to;
}

// Fields without words in glTF: those of kuafu_material_desc by their names.
void GltfMaterials::read_extras(const tinygltf::Value& extras, const std::string& field, Material& to) {
  for (const auto& [name, value] : extras_numbers(to)) *value = static_cast<float>(number_of(extras, name, *value));
  for (const auto& [name, value] : extras_flags(to))
    if (extras.IsObject() && extras.Has(name)) *value = number_of(extras, name, 0.0) != 0.0;
  for (const auto& [name, value] : extras_vectors(to))
    if (extras.IsObject() && extras.Has(name))
      for (int i = 0; i < 3; ++i) (*value)[i] = static_cast<float>(extras.Get(name).Get(i).GetNumberAsDouble());
  for (const auto& [name, id] : extras_textures(to)) {
    const std::string user = field + ".extras." + name;
    *id = textures_.id(TextureUse::of(extras, name, user), false, user);
  }
}

void GltfMaterials::read_extensions(const tinygltf::Material& from, const std::string& field, Material& to) {
  const auto extension = [&](const char* name) { return extension_of(from, name); };
  if (const auto* e = extension("KHR_materials_ior")) {
    // ior 0 means total reflection for every angle (KHR_materials_ior, "Interaction with other extensions"): the limit of a huge index.
    const double ior = number_of(*e, "ior", 1.5);
    to.ior = ior == 0.0 ? 1e6f : static_cast<float>(ior);
  }
  if (const auto* e = extension("KHR_materials_transmission")) {
    to.transmission = static_cast<float>(number_of(*e, "transmissionFactor", 0.0));
    to.transmission_texture =
        textures_.id(TextureUse::of(*e, "transmissionTexture", field + ".transmissionTexture"), false, field + ".transmissionTexture");
    if (e->Has("transmissionTexture") && to.transmission_texture == none) to.transmission = 0.0f;
  }
  if (const auto* e = extension("KHR_materials_specular")) {
    to.specular = static_cast<float>(number_of(*e, "specularFactor", 1.0));
    to.specular_texture =
        textures_.id(TextureUse::of(*e, "specularTexture", field + ".specularTexture"), false, field + ".specularTexture");
    read_specular_color(*e, field, to);
  }
  to.transmission_roughness = to.roughness;
  const auto* volume = extension("KHR_materials_volume");
  const double thickness = volume == nullptr ? 0.0 : number_of(*volume, "thicknessFactor", 0.0);
  const bool lets_through =
      extension("KHR_materials_transmission") != nullptr || extension("KHR_materials_diffuse_transmission") != nullptr;
  to.thin_walled = lets_through && thickness == 0.0;  // as KHR_materials_volume has it
  if (to.thin_walled && volume != nullptr && volume->Has("attenuationDistance"))
    import_.warn(field + ": attenuationDistance is not used, for thicknessFactor is 0: it is a sheet");
  if (const auto* e = volume) {
    to.attenuation_distance_m = static_cast<float>(number_of(*e, "attenuationDistance", 0.0));
    read_color(*e, "attenuationColor", to.attenuation_color);
  }
  read_lobes(from, field, to);
  if (extension("KHR_materials_unlit") != nullptr) read_unlit(field, to);
  if (const auto* e = extension("KHR_materials_emissive_strength"))
    to.emission *= static_cast<float>(number_of(*e, "emissiveStrength", 1.0));
}

// The reflecting layer has a weight for all channels.
void GltfMaterials::read_specular_color(const tinygltf::Value& extension, const std::string& field, Material& to) {
  if (extension.Has("specularColorTexture")) import_.warn(field + ": specularColorTexture is ignored");
  glm::vec3 color(1.0f);
  read_color(extension, "specularColorFactor", color);
  if (color == glm::vec3(1.0f)) return;
  const float mean = to.specular * (color.r + color.g + color.b) / 3.0f;
  to.specular = std::clamp(mean, 0.0f, 1.0f);
  if (mean > 1.0f || color.r != color.g || color.g != color.b)
    import_.warn(field + ": of specularColorFactor the mean is taken, 1 at most");
}

// Its colour is to be seen as it is in every light, which no surface does: it becomes matt.
void GltfMaterials::read_unlit(const std::string& field, Material& to) {
  to.metallic = to.specular = 0.0f;
  to.roughness = 1.0f;
  to.metallic_roughness_texture = to.normal_texture = none;
  import_.warn(field + ": KHR_materials_unlit is shown as a matt surface, which is as bright as the light that falls on it");
}

void GltfMaterials::read_lobes(const tinygltf::Material& from, const std::string& field, Material& to) {
  const tinygltf::Value* e = nullptr;
  const auto number = [&](const char* name, double fallback) { return static_cast<float>(number_of(*e, name, fallback)); };
  const auto texture = [&](const char* name, bool srgb = false) {
    return textures_.id(TextureUse::of(*e, name, field + "." + name), srgb, field + "." + name);
  };
  if ((e = extension_of(from, "KHR_materials_clearcoat")) != nullptr) {
    to.clearcoat = number("clearcoatFactor", 0);
    to.clearcoat_roughness = number("clearcoatRoughnessFactor", 0);
    to.clearcoat_texture = texture("clearcoatTexture");
    to.clearcoat_roughness_texture = texture("clearcoatRoughnessTexture");
    to.clearcoat_normal_texture = texture("clearcoatNormalTexture");
    if (e->Has("clearcoatNormalTexture"))
      to.clearcoat_normal_scale = static_cast<float>(number_of(e->Get("clearcoatNormalTexture"), "scale", 1.0));
  }
  if ((e = extension_of(from, "KHR_materials_diffuse_transmission")) != nullptr) {
    to.diffuse_transmission = number("diffuseTransmissionFactor", 0);
    read_color(*e, "diffuseTransmissionColorFactor", to.diffuse_transmission_color);
    to.diffuse_transmission_texture = texture("diffuseTransmissionTexture");
    to.diffuse_transmission_color_texture = texture("diffuseTransmissionColorTexture", true);
  }
  if ((e = extension_of(from, "KHR_materials_anisotropy")) != nullptr) {
    to.anisotropy = number("anisotropyStrength", 0);
    to.anisotropy_rotation_rad = number("anisotropyRotation", 0);
    to.anisotropy_texture = texture("anisotropyTexture");
  }
  if ((e = extension_of(from, "KHR_materials_sheen")) != nullptr) {
    read_color(*e, "sheenColorFactor", to.sheen_color);
    to.sheen_roughness = number("sheenRoughnessFactor", 0);
    to.sheen_color_texture = texture("sheenColorTexture", true);
    to.sheen_roughness_texture = texture("sheenRoughnessTexture");
  }
  if ((e = extension_of(from, "KHR_materials_iridescence")) != nullptr) {
    to.iridescence = number("iridescenceFactor", 0);
    to.iridescence_ior = number("iridescenceIor", 1.3);
    to.iridescence_least_thickness_nm = number("iridescenceThicknessMinimum", 100);
    to.iridescence_thickness_nm = number("iridescenceThicknessMaximum", 400);
    to.iridescence_texture = texture("iridescenceTexture");
    to.iridescence_thickness_texture = texture("iridescenceThicknessTexture");
  }
  if ((e = extension_of(from, "KHR_materials_dispersion")) != nullptr) to.dispersion = number("dispersion", 0);
}

}  // namespace kuafu
