// SPDX-License-Identifier: Apache-2.0
#include "material/material_record.h"

#include <algorithm>
#include <cmath>

#include "shared/wave.h"

namespace kuafu {
namespace {

// Beer and Lambert: white light has this colour after the given distance. Black would be opaque; the value in its place lets e^-20 through.
float attenuation(float color, float distance_m) { return distance_m > 0.0f ? -std::log(std::max(color, 2e-9f)) / distance_m : 0.0f; }

/// Albedo of one scattering whose body, endless and evenly lit, has the given albedo: van de Hulst's spherical albedo of isotropic
/// scattering (Multiple Light Scattering, 1980), (1 - s) (1 - 0.139 s) / (1 + 1.17 s) with s^2 = 1 - albedo, solved for s.
float single_albedo(float albedo) {
  const double b = 1.139 + 1.17 * double(albedo), s = (b - std::sqrt(b * b - 4 * 0.139 * (1 - double(albedo)))) / (2 * 0.139);
  return float(1 - s * s);
}

/// (n - 1) / (ior - 1) - 1 at 850 nm for a dispersion of 1: Cauchy's law, as lib/dispersion.glsl has it for the visible band.
constexpr float cauchy_part_850 = -0.0396032f;

/// A colour that may have its own in the infrared band, and then no texture.
void take_infrared(glm::vec3& color, uint32_t& texture, float infrared) {
  if (std::isnan(infrared)) {
    color = glm::vec3(color.r);
    return;
  }
  color = glm::vec3(infrared);
  texture = none;
}

}  // namespace

Material in_band(const Material& material, const Band& band) {
  Material m = material;
  if (!band.infrared) return m;
  const float albedo = m.ir_albedo_texture != none ? 1.0f : m.base_color.r;
  m.base_color = glm::vec4(glm::vec3(band.number(albedo, m.ir_albedo)), m.base_color.a);
  if (m.ir_albedo_texture != none || !std::isnan(m.ir_albedo)) m.base_color_texture = m.ir_albedo_texture;
  m.emission = band.color(m.emission, m.ir_emission);
  m.attenuation_color = band.color(m.attenuation_color, m.ir_attenuation_color);
  take_infrared(m.diffuse_transmission_color, m.diffuse_transmission_color_texture, m.ir_diffuse_transmission_color);
  take_infrared(m.sheen_color, m.sheen_color_texture, m.ir_sheen_color);
  m.subsurface_color = band.color(m.subsurface_color, m.ir_subsurface_color);
  m.subsurface_radius_m = band.color(m.subsurface_radius_m, m.ir_subsurface_radius_m);
  m.roughness = band.number(m.roughness, m.ir_roughness);
  m.transmission = band.number(m.transmission, m.ir_transmission);
  m.transmission_roughness = band.number(m.transmission_roughness, m.ir_transmission_roughness);
  if (m.dispersion > 0.0f && bends_light(m)) m.ior = std::max(1.0f + (m.ior - 1.0f) * (1.0f + m.dispersion * cauchy_part_850), 1.0f);
  m.dispersion = 0.0f;
  m.ior = band.number(m.ior, m.ir_ior);
  return m;
}

MaterialRecord material_record(const Material& material, uint32_t id, const Band& band, const Table<Texture>& textures) {
  Material m = in_band(material, band);
  for (uint32_t* texture : texture_ids(m)) *texture = slot_or_none(textures, *texture);
  MaterialRecord r{};
  copy_fields(m, r);
  r.base_color = glm::vec3(m.base_color);
  r.id = id;
  for (int i = 0; i < 3; ++i) {
    r.attenuation[i] = attenuation(m.attenuation_color[i], m.attenuation_distance_m);
    r.subsurface_albedo[i] = single_albedo(m.subsurface_color[i]);
    r.subsurface_extinction[i] = 1 / m.subsurface_radius_m[i];
  }
  r.coat = m.bsdf == Material::Bsdf::paper ? 0.0f : 1.0f;
  r.textured = std::ranges::any_of(texture_ids(m), [](const uint32_t* id) { return *id != none; }) ? 1 : 0;
  r.alpha = m.base_color.a;
  r.alpha_texture = slot_or_none(textures, material.base_color_texture);
  r.colored = !band.infrared || (material.ir_albedo_texture == none && std::isnan(material.ir_albedo)) ? 1 : 0;
  r.anisotropy_cos = std::cos(m.anisotropy_rotation_rad);
  r.anisotropy_sin = std::sin(m.anisotropy_rotation_rad);
  r.needs = material_features(m);
  return r;
}

uint32_t material_features(const Material& m) {
  const bool body = m.thin_walled || m.attenuation_distance_m > 0.0f;  // that differs from clear glass
  const bool special = m.diffuse_roughness > 0.0f || (m.transmission > 0.0f && (m.transmission_roughness > 0.0f || body)) ||
                       (m.diffuse_transmission > 0.0f && body);
  const bool scaled = m.normal_texture != none && m.normal_scale != 1.0f;
  return (special ? feature_materials : 0) | (scaled ? feature_lookups : 0) |
         (m.alpha_mode != Material::AlphaMode::opaque ? feature_cutouts | feature_lookups : 0) |
         (m.subsurface > 0.0f ? feature_subsurface : 0) | (m.clearcoat > 0.0f ? feature_clearcoat : 0) |
         (m.diffuse_transmission > 0.0f ? feature_diffuse_transmission : 0) | (m.anisotropy > 0.0f ? feature_anisotropy : 0) |
         (has_sheen(m) ? feature_sheen : 0) | (m.iridescence > 0.0f ? feature_iridescence : 0) |
         (m.dispersion > 0.0f && m.transmission > 0.0f ? feature_dispersion : 0);
}

bool has_sheen(const Material& m) { return m.sheen_color != glm::vec3(0); }

bool is_glass(const Material& m) { return m.transmission > 0.0f && (m.metallic < 1.0f || m.metallic_roughness_texture != none); }

bool is_smooth_glass(const Material& m) {
  constexpr float rough = 0.0317f;  // whose alpha is mirror_alpha (lib/glass.glsl)
  return is_glass(m) && (m.transmission_roughness < rough || m.ior < 1.001f || m.metallic_roughness_texture != none);
}

bool bends_light(const Material& m) { return is_smooth_glass(m) && !m.thin_walled; }

bool is_frosted(const Material& m) { return is_glass(m) && m.transmission_roughness > 0.0f && !m.thin_walled; }

Material grey_default() {
  Material m;
  m.base_color = glm::vec4(0.5f, 0.5f, 0.5f, 1.0f);
  m.specular = 0.0f;
  return m;
}

}  // namespace kuafu
