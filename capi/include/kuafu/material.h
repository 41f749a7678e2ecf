/* kuafu: materials. Included by kuafu.h, whose conventions hold. */
#ifndef KUAFU_MATERIAL_H
#define KUAFU_MATERIAL_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "ks/header.h"

#define KUAFU_NONE 0xffffffffu /* no texture, no mesh, ... */

#define KUAFU_TYPE_MATERIAL_DESC 0x1003u

#define KUAFU_BSDF_GLTF 0u  /* glTF 2.0's: a dielectric's base lies under a reflecting layer, with Fresnel's exact reflectance of ior times specular;
                               the base gets and gives what the layer lets through (Kelemen and Szirmay-Kalos 2001): a white one loses nothing */
#define KUAFU_BSDF_PAPER 1u /* w f_diffuse + (1 - w) f_specular, w = (1 - metallic)(1 - transmission): no layer */

/* glTF 2.0's material model: GGX (alpha = roughness squared), metallic-roughness, KHR_materials_ior/specular/transmission/volume; no roughness
 * loses or creates light. As KHR_materials_volume has it, transmission without its thicknessFactor is read as thin_walled. Fields that glTF has no
 * words for are read from a material's extras under their names here; textures there as {"index": n}. */
typedef struct kuafu_material_desc {
  ks_header header;
  const char* name;
  float base_color[4];       /* linear RGB + alpha */
  float metallic;            /* 0..1 */
  float roughness;           /* 0..1 */
  float specular;            /* 0..1; 0 with metallic 0 is exactly Lambertian */
  float ior;                 /* >= 1 */
  float transmission;        /* 0..1 */
  float emission[3];         /* radiance, W/(sr m^2) in the visible band */
  float ir_albedo;           /* diffuse albedo (or metal reflectance) in the infrared band; NAN = red of base colour */
  float ir_emission;         /* radiance in the infrared band */
  uint32_t base_color_texture; /* texture ids or KUAFU_NONE; each multiplies its factor */
  uint32_t metallic_roughness_texture; /* G = roughness, B = metallic */
  uint32_t normal_texture;
  uint32_t emission_texture;
  uint32_t transmission_texture; /* R */
  uint32_t specular_texture;     /* A */
  float transmission_roughness;  /* of the glass, 0..1; 0 = clear. Files give it their roughness */
  float diffuse_roughness;       /* 0..1: Oren and Nayar's, in Fujii's form; 0 = Lambert */
  float attenuation_color[3];    /* of white light after attenuation_distance_m inside the glass (KHR_materials_volume) */
  float ir_attenuation_color;    /* NAN = red */
  float attenuation_distance_m;  /* 0 = nothing is absorbed */
  uint32_t bsdf;                 /* KUAFU_BSDF_* */
  uint32_t light_group;          /* that its emission belongs to, 0..3 */
  uint32_t ior_texture;          /* R: ior = 1 + (ior - 1) R */
  uint32_t ir_albedo_texture;    /* R, times ir_albedo (1 where that is NAN); KUAFU_NONE and ir_albedo NAN: red of base_color_texture */
  float ir_roughness, ir_ior, ir_transmission, ir_transmission_roughness; /* what these are in the infrared band; NAN = the same */
  float subsurface;              /* 0..1: share of the diffuse base whose light wanders below the surface of the (closed) body; seen from outside */
  float subsurface_color[3];     /* 0..1: its albedo, where the body is big against the radius; base_color does not tint it */
  float subsurface_radius_m[3];  /* > 0: mean free path; at least 1e-4 of the distance to the world's origin is resolved. Scattering is even;
                                    projector light that wandered is projector indirect: what is left direct has no noise */
  float ir_subsurface_color;     /* NAN = red */
  float ir_subsurface_radius_m;  /* NAN = red */
  uint32_t thin_walled;          /* nonzero: its glass is a sheet, not the skin of a body: light goes through both faces at once and straight on, after all
                                    reflections between them; base_color is what one way across leaves, attenuation is not used */
  uint32_t reserved;
} kuafu_material_desc;
static inline kuafu_material_desc kuafu_material_desc_init(void) {
  kuafu_material_desc m;
  memset(&m, 0, sizeof m);
  m.header = ks_header_make(KUAFU_TYPE_MATERIAL_DESC, (uint32_t)sizeof m);
  m.base_color[0] = m.base_color[1] = m.base_color[2] = m.base_color[3] = 1.0f;
  m.roughness = 1.0f;
  m.specular = 1.0f;
  m.ior = 1.5f;
  m.ir_albedo = NAN;
  m.ior_texture = m.ir_albedo_texture = KUAFU_NONE;
  m.subsurface_color[0] = m.subsurface_color[1] = m.subsurface_color[2] = 1.0f;
  m.subsurface_radius_m[0] = m.subsurface_radius_m[1] = m.subsurface_radius_m[2] = 1e-3f;
  m.ir_subsurface_color = m.ir_subsurface_radius_m = NAN;
  m.ir_roughness = m.ir_ior = m.ir_transmission = m.ir_transmission_roughness = NAN;
  m.base_color_texture = m.metallic_roughness_texture = m.normal_texture = KUAFU_NONE;
  m.emission_texture = m.transmission_texture = m.specular_texture = KUAFU_NONE;
  m.attenuation_color[0] = m.attenuation_color[1] = m.attenuation_color[2] = 1.0f;
  m.ir_attenuation_color = NAN;
  return m;
}

#endif
