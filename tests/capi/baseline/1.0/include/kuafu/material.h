/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_MATERIAL_H
#define KUAFU_MATERIAL_H
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_MATERIAL_DESC 0x1003u
#define KUAFU_BSDF_GLTF 0u
#define KUAFU_BSDF_PAPER 1u
#define KUAFU_ALPHA_OPAQUE 0u
#define KUAFU_ALPHA_MASK 1u
#define KUAFU_ALPHA_BLEND 2u
typedef struct kuafu_material_desc {
  ks_header header;
  const char* name;
  float base_color[4];
  uint32_t base_color_texture;
  float metallic;
  float roughness;
  uint32_t metallic_roughness_texture;
  float specular;
  uint32_t specular_texture;
  float ior;
  uint32_t ior_texture;
  float diffuse_roughness;
  uint32_t bsdf;
  float ir_albedo;
  uint32_t ir_albedo_texture;
  float ir_roughness;
  float ir_ior;
  uint32_t normal_texture;
  float normal_scale;
  uint32_t alpha_mode;
  float alpha_cutoff;
  float emission[3];
  uint32_t emission_texture;
  float ir_emission;
  uint32_t light_group;
  float transmission;
  uint32_t transmission_texture;
  float transmission_roughness;
  uint32_t thin_walled;
  float attenuation_color[3];
  float attenuation_distance_m;
  float dispersion;
  float ir_transmission;
  float ir_transmission_roughness;
  float ir_attenuation_color;
  float diffuse_transmission;
  uint32_t diffuse_transmission_texture;
  float diffuse_transmission_color[3];
  uint32_t diffuse_transmission_color_texture;
  float ir_diffuse_transmission_color;
  float subsurface;
  float subsurface_color[3];
  float subsurface_radius_m[3];
  float ir_subsurface_color;
  float ir_subsurface_radius_m;
  float clearcoat;
  uint32_t clearcoat_texture;
  float clearcoat_roughness;
  uint32_t clearcoat_roughness_texture;
  uint32_t clearcoat_normal_texture;
  float clearcoat_normal_scale;
  float anisotropy;
  float anisotropy_rotation_rad;
  uint32_t anisotropy_texture;
  float sheen_color[3];
  uint32_t sheen_color_texture;
  float sheen_roughness;
  uint32_t sheen_roughness_texture;
  float ir_sheen_color;
  float iridescence;
  uint32_t iridescence_texture;
  float iridescence_ior;
  float iridescence_thickness_nm;
  float iridescence_least_thickness_nm;
  uint32_t iridescence_thickness_texture;
} kuafu_material_desc;
static inline kuafu_material_desc kuafu_material_desc_init(void) {
  kuafu_material_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_MATERIAL_DESC, KS_CAST(uint32_t, sizeof s));
  s.base_color[0] = 1.0f;
  s.base_color[1] = 1.0f;
  s.base_color[2] = 1.0f;
  s.base_color[3] = 1.0f;
  s.roughness = 1.0f;
  s.specular = 1.0f;
  s.ior = 1.5f;
  s.ir_albedo = NAN;
  s.ir_roughness = NAN;
  s.ir_ior = NAN;
  s.normal_scale = 1.0f;
  s.alpha_cutoff = 0.5f;
  s.attenuation_color[0] = 1.0f;
  s.attenuation_color[1] = 1.0f;
  s.attenuation_color[2] = 1.0f;
  s.ir_transmission = NAN;
  s.ir_transmission_roughness = NAN;
  s.ir_attenuation_color = NAN;
  s.diffuse_transmission_color[0] = 1.0f;
  s.diffuse_transmission_color[1] = 1.0f;
  s.diffuse_transmission_color[2] = 1.0f;
  s.ir_diffuse_transmission_color = NAN;
  s.subsurface_color[0] = 1.0f;
  s.subsurface_color[1] = 1.0f;
  s.subsurface_color[2] = 1.0f;
  s.subsurface_radius_m[0] = 0.001f;
  s.subsurface_radius_m[1] = 0.001f;
  s.subsurface_radius_m[2] = 0.001f;
  s.ir_subsurface_color = NAN;
  s.ir_subsurface_radius_m = NAN;
  s.clearcoat_normal_scale = 1.0f;
  s.ir_sheen_color = NAN;
  s.iridescence_ior = 1.3f;
  s.iridescence_thickness_nm = 400.0f;
  s.iridescence_least_thickness_nm = 100.0f;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
