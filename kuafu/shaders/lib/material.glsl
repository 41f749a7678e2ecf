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
  float diffuse_transmission;  // share of the diffuse base, and
  Spectrum beyond;             // its colour
  bool thin_walled;  // the glass is a sheet
};

/// Without a body behind it: nothing absorbs there, and no path is inside.
bool is_sheet(IN(MaterialPoint) m) { return (features & feature_materials) != 0u && m.thin_walled; }

/// World directions in which a texture's own coordinates grow.
void texture_tangents(IN(TextureRecord) t, IN(Surface) s, OUT(vec3) tangent_u, OUT(vec3) tangent_v) {
  tangent_u = s.tangent_u;
  tangent_v = s.tangent_v;
  if ((features & feature_lookups) == 0u || t.lookup == 0u) return;
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
void apply_normal_map(IN(SceneAddresses) scene, IN(MaterialRecord) m, INOUT(Surface) s) {
  if (m.normal_texture == no_texture) return;
  vec3 map = xyz(material_texel(scene, m.normal_texture, s.place)) * 2.0f - 1.0f;
  if ((features & feature_lookups) != 0u) map = vec3(map.x * m.normal_scale, map.y * m.normal_scale, map.z);
  vec3 tangent_u, tangent_v;
  texture_tangents(scene.textures.at[m.normal_texture], s, tangent_u, tangent_v);
  vec3 tangent = tangent_u - s.shading_normal * dot(tangent_u, s.shading_normal);
  float length_squared = dot(tangent, tangent);
  if (length_squared == 0.0f) return;
  tangent *= inversesqrt(length_squared);
  vec3 bitangent = cross(s.shading_normal, tangent);
  if (dot(bitangent, tangent_v) > 0.0f) bitangent = -bitangent;
  vec3 n = normalize(tangent * map.x + bitangent * map.y + s.shading_normal * max(map.z, 1e-3f));
  if (dot(n, s.geometric_normal) > 0.0f) s.shading_normal = n;
}

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
  p.transmission_roughness = p.diffuse_roughness = p.subsurface = p.clearcoat = p.clearcoat_roughness = 0.0f;
  p.thin_walled = false;
  p.diffuse_transmission = 0.0f;
  p.beyond = Spectrum(0.0f);
  if ((features & feature_subsurface) != 0u) p.subsurface = m.subsurface;
  if ((features & feature_materials) != 0u) {
    if (m.thin_walled == 0u) p.attenuation = band_of(m.attenuation);
    p.thin_walled = m.thin_walled != 0u;
    p.transmission_roughness = m.transmission_roughness;
    p.diffuse_roughness = m.diffuse_roughness;
  }
  if ((features & feature_clearcoat) != 0u) {
    p.clearcoat = m.clearcoat;
    p.clearcoat_roughness = m.clearcoat_roughness;
  }
  if ((features & feature_diffuse_transmission) != 0u) {
    p.diffuse_transmission = m.diffuse_transmission;
    p.beyond = band_of(m.diffuse_transmission_color);
  }
  if ((features & feature_lookups) != 0u && m.colored != 0u) p.base *= band_of(xyz(s.color));
  if (m.textured == 0u) return p;
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
  apply_normal_map(scene, m, s);
  return p;
}
#endif
