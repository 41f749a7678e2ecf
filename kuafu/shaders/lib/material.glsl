// SPDX-License-Identifier: Apache-2.0
// A material at a point: factors times textures, in the band being rendered.
#ifndef KUAFU_MATERIAL_GLSL
#define KUAFU_MATERIAL_GLSL
#include "lib/spectrum.glsl"
#include "lib/surface.glsl"
#include "lib/texture.glsl"
#include "shared/wave.h"

struct MaterialPoint {
  Spectrum base;  // diffuse albedo, or metal reflectance
  Spectrum emission;
  float metallic, roughness, specular, ior, transmission;
  float coat;         // specular of the layer over the base
  Spectrum attenuation;  // inside, 1/m
  float transmission_roughness, diffuse_roughness;
  float subsurface;  // share of the diffuse base
  float clearcoat, clearcoat_roughness;
  vec3 clearcoat_normal;  // world; in the shading frame for a BSDF
  float diffuse_transmission;  // share of the diffuse base, and
  Spectrum beyond;             // its colour
  float anisotropy;
  vec3 tangent;  // world: the direction of anisotropy, which stands on the shading normal
  Spectrum sheen;
  float sheen_roughness;
  float iridescence, iridescence_ior, thin_film_nm;
  float dispersion;
  Spectrum carries;  // what of each channel the path still has, where dispersion takes one of them
  bool thin_walled;  // the glass is a sheet
};

/// Without a body behind it: nothing absorbs there, and no path is inside.
bool is_sheet(IN(MaterialPoint) m) { return (features & feature_materials) != 0u && m.thin_walled; }

/// World directions in which a texture's own coordinates grow; tangents of the mesh stand for those of any.
void texture_tangents(IN(TextureRecord) t, IN(Surface) s, OUT(vec3) tangent_u, OUT(vec3) tangent_v) {
  tangent_u = s.tangent_u;
  tangent_v = s.tangent_v;
  if ((features & feature_lookups) == 0u || t.lookup == 0u || s.own_tangents) return;
  if ((t.lookup & lookup_uv_1) != 0u) {
    tangent_u = s.tangent_u_1;
    tangent_v = s.tangent_v_1;
  }
  if ((t.lookup & lookup_transform) == 0u) return;
  // The inverse of the transform's matrix, but for its determinant, of which only the sign matters.
  vec3 a = t.transform[0], b = t.transform[1], u = tangent_u, v = tangent_v;
  float scale = a.x * b.y - a.y * b.x < 0.0f ? -1.0f : 1.0f;
  tangent_u = (u * b.y - v * b.x) * scale;
  tangent_v = (v * a.x - u * a.y) * scale;
}

// Tangent-space normal map of glTF: x along growing u, y against growing v (v points down).
vec3 mapped_normal(IN(SceneAddresses) scene, uint texture, float scale, IN(Surface) s) {
  if (texture == no_texture) return s.shading_normal;
  vec3 map = xyz(material_texel(scene, texture, s.place)) * 2.0f - 1.0f;
  map = vec3(map.x * scale, map.y * scale, map.z);
  vec3 tangent_u, tangent_v;
  texture_tangents(scene.textures.at[texture], s, tangent_u, tangent_v);
  vec3 tangent = tangent_u - s.shading_normal * dot(tangent_u, s.shading_normal);
  float length_squared = dot(tangent, tangent);
  if (length_squared == 0.0f) return s.shading_normal;
  tangent *= inversesqrt(length_squared);
  vec3 bitangent = cross(s.shading_normal, tangent);
  if (dot(bitangent, tangent_v) > 0.0f) bitangent = -bitangent;
  vec3 n = normalize(tangent * map.x + bitangent * map.y + s.shading_normal * max(map.z, 1e-3f));
  return dot(n, s.geometric_normal) > 0.0f ? n : s.shading_normal;
}

/// The direction of anisotropy: KHR_materials_anisotropy's, in the tangent space of its texture's coordinates, or the normal map's. 0: there is none.
vec3 anisotropy_tangent(IN(SceneAddresses) scene, IN(MaterialRecord) m, IN(Surface) s, vec2 direction) {
  uint texture = m.anisotropy_texture != no_texture ? m.anisotropy_texture : m.normal_texture;
  vec3 tangent = s.tangent_u, tangent_v = s.tangent_v;
  if (texture != no_texture) texture_tangents(scene.textures.at[texture], s, tangent, tangent_v);
  tangent -= s.shading_normal * dot(tangent, s.shading_normal);
  float length_squared = dot(tangent, tangent);
  if (length_squared == 0.0f) return vec3(0.0f);
  tangent *= inversesqrt(length_squared);
  vec3 bitangent = cross(s.shading_normal, tangent);
  if (dot(bitangent, tangent_v) > 0.0f) bitangent = -bitangent;
  return tangent * (m.anisotropy_cos * direction.x - m.anisotropy_sin * direction.y) +
         bitangent * (m.anisotropy_sin * direction.x + m.anisotropy_cos * direction.y);
}

/// After the surface has its normal and p.tangent the direction in the tangent space.
void load_anisotropy(IN(SceneAddresses) scene, IN(MaterialRecord) m, IN(Surface) s, INOUT(MaterialPoint) p) {
  if (p.anisotropy == 0.0f) return;
  vec2 direction = xy(p.tangent);
  p.tangent = anisotropy_tangent(scene, m, s, direction * inversesqrt(max(dot(direction, direction), 1e-12f)));
  if (dot(p.tangent, p.tangent) == 0.0f) p.anisotropy = 0.0f;
}

/// What the lobes over and under the usual ones have, before their textures.
void load_lobes(IN(MaterialRecord) m, INOUT(MaterialPoint) p) {
  p.clearcoat = p.clearcoat_roughness = p.diffuse_transmission = 0.0f;
  p.beyond = Spectrum(0.0f);
  p.anisotropy = p.sheen_roughness = p.iridescence = p.iridescence_ior = p.thin_film_nm = p.dispersion = 0.0f;
  p.tangent = vec3(1.0f, 0.0f, 0.0f);
  p.sheen = Spectrum(0.0f);
  p.carries = Spectrum(1.0f);
  if ((features & feature_clearcoat) != 0u) {
    p.clearcoat = m.clearcoat;
    p.clearcoat_roughness = m.clearcoat_roughness;
  }
  if ((features & feature_diffuse_transmission) != 0u) {
    p.diffuse_transmission = m.diffuse_transmission;
    p.beyond = band_of(m.diffuse_transmission_color);
  }
  if ((features & feature_sheen) != 0u) {
    p.sheen = band_of(m.sheen_color);
    p.sheen_roughness = m.sheen_roughness;
  }
  if ((features & feature_iridescence) != 0u) {
    p.iridescence = m.iridescence;
    p.iridescence_ior = m.iridescence_ior;
    p.thin_film_nm = m.iridescence_thickness_nm;
  }
  if ((features & feature_anisotropy) != 0u) p.anisotropy = m.anisotropy;
  if ((features & feature_dispersion) != 0u) p.dispersion = m.dispersion;
}

// Texture k of those lobes. They are read in one loop: a compiler that inlines everything first then meets one read, not nine.
const uint lobe_textures = 9u;
uint lobe_texture(IN(MaterialRecord) m, uint k) {
  if (k < 2u) return (features & feature_clearcoat) == 0u ? no_texture : k == 0u ? m.clearcoat_texture : m.clearcoat_roughness_texture;
  if (k < 4u) {
    if ((features & feature_diffuse_transmission) == 0u) return no_texture;
    return k == 2u ? m.diffuse_transmission_texture : m.diffuse_transmission_color_texture;
  }
  if (k < 6u) return (features & feature_sheen) == 0u ? no_texture : k == 4u ? m.sheen_color_texture : m.sheen_roughness_texture;
  if (k < 8u) return (features & feature_iridescence) == 0u ? no_texture : k == 6u ? m.iridescence_texture : m.iridescence_thickness_texture;
  return (features & feature_anisotropy) == 0u ? no_texture : m.anisotropy_texture;
}

void read_lobe_textures(IN(SceneAddresses) scene, IN(MaterialRecord) m, IN(TexturePlace) place, INOUT(MaterialPoint) p) {
  for (uint k = 0u; k < lobe_textures; ++k) {
    uint texture = lobe_texture(m, k);
    if (texture == no_texture) continue;
    vec4 map = material_texel(scene, texture, place);
    if (k == 0u) p.clearcoat *= map.r;
    if (k == 1u) p.clearcoat_roughness *= map.g;
    if (k == 2u) p.diffuse_transmission *= map.a;
    if (k == 3u) p.beyond *= band_of(xyz(map));
    if (k == 4u) p.sheen *= band_of(xyz(map));
    if (k == 5u) p.sheen_roughness *= map.a;
    if (k == 6u) p.iridescence *= map.r;
    if (k == 7u) p.thin_film_nm = mix(m.iridescence_least_thickness_nm, p.thin_film_nm, map.g);
    if (k == 8u) {
      p.tangent = vec3(map.r * 2.0f - 1.0f, map.g * 2.0f - 1.0f, 0.0f);
      p.anisotropy *= map.b;
    }
  }
}

const uint feature_lobe_textures = feature_clearcoat | feature_diffuse_transmission | feature_sheen | feature_iridescence | feature_anisotropy;

MaterialPoint load_material(IN(SceneAddresses) scene, IN(MaterialRecord) m, INOUT(Surface) s) {
  MaterialPoint p;
  p.base = band_of(m.base_color);
  p.emission = band_of(m.emission);
  p.metallic = m.metallic;
  p.roughness = m.roughness;
  p.specular = m.specular;
  p.ior = m.ior;
  p.transmission = m.transmission;
  p.coat = m.specular * m.coat;
  p.attenuation = Spectrum(0.0f);
  p.transmission_roughness = p.diffuse_roughness = p.subsurface = 0.0f;
  p.thin_walled = false;
  if ((features & feature_subsurface) != 0u) p.subsurface = m.subsurface;
  if ((features & feature_materials) != 0u) {
    if (m.thin_walled == 0u) p.attenuation = band_of(m.attenuation);
    p.thin_walled = m.thin_walled != 0u;
    p.transmission_roughness = m.transmission_roughness;
    p.diffuse_roughness = m.diffuse_roughness;
  }
  load_lobes(m, p);
  p.clearcoat_normal = s.shading_normal;
  if ((features & feature_lookups) != 0u && m.colored != 0u) p.base *= band_of(xyz(s.color));
  if (m.textured == 0u) {
    if ((features & feature_anisotropy) != 0u) load_anisotropy(scene, m, s, p);
    return p;
  }
  vec4 base = material_texel(scene, m.base_color_texture, s.place);
  p.base *= band_of(xyz(base));
  vec4 emission = material_texel(scene, m.emission_texture, s.place);
  p.emission *= band_of(xyz(emission));
  vec4 metallic_roughness = material_texel(scene, m.metallic_roughness_texture, s.place);
  p.roughness *= metallic_roughness.g;
  p.transmission_roughness *= metallic_roughness.g;
  p.metallic *= metallic_roughness.b;
  p.transmission *= material_texel(scene, m.transmission_texture, s.place).r;
  p.specular *= material_texel(scene, m.specular_texture, s.place).a;
  p.coat = p.specular * m.coat;
  p.ior = 1.0f + (p.ior - 1.0f) * material_texel(scene, m.ior_texture, s.place).r;
  if ((features & feature_lobe_textures) != 0u) read_lobe_textures(scene, m, s.place, p);
  if ((features & feature_clearcoat) != 0u && m.clearcoat > 0.0f)
    p.clearcoat_normal = mapped_normal(scene, m.clearcoat_normal_texture, m.clearcoat_normal_scale, s);
  s.shading_normal = mapped_normal(scene, m.normal_texture, (features & feature_lookups) != 0u ? m.normal_scale : 1.0f, s);
  if ((features & feature_anisotropy) != 0u) load_anisotropy(scene, m, s, p);
  return p;
}
#endif
