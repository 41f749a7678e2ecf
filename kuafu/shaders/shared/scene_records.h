// The scene as shaders see it, read by GLSL and C++ (scalar layout). Tables stand in buffers whose device addresses are in SceneAddresses.
#ifndef KUAFU_SCENE_RECORDS_H
#define KUAFU_SCENE_RECORDS_H

#include "shared/arrays.h"
#include "shared/ray_queue.h"

#ifdef __cplusplus
namespace kuafu {
#endif

KUAFU_CONST instance_has_normals = 1u;
KUAFU_CONST instance_has_uvs = 2u;
KUAFU_CONST instance_has_slots = 4u;

struct InstanceRecord {
  Vec3Array positions;
  Vec3Array normals;
  Vec2Array uvs;
  UVec3Array indices;
  UintArray slots;
  vec4 local_to_world[3];   // rows
  vec3 normal_to_world[3];  // rows of the inverse transpose
  uint flags;               // instance_has_*
  uint first_material;      // slot s has material SceneAddresses.instance_materials[first_material + min(s, material_count)]
  uint material_count;
  uint id;
};
KUAFU_ARRAY(InstanceArray, InstanceRecord, 8)

struct MaterialRecord {
  vec3 base_color;
  float metallic, roughness, specular, ior, transmission;
  vec3 emission;
  float ir_albedo, ir_emission;
  uint id;        // scene id, or none for the grey default
  uint textured;  // nonzero: any of the textures below
  uint base_color_texture, ir_albedo_texture, metallic_roughness_texture, normal_texture;
  uint emission_texture, transmission_texture, specular_texture;
};
KUAFU_ARRAY(MaterialArray, MaterialRecord, 4)

KUAFU_CONST no_texture = 0xffffffffu;
KUAFU_CONST texel_half4 = 0u;
KUAFU_CONST texel_float4 = 1u;

/// Linear RGBA texels, row 0 first.
struct TextureRecord {
  UintArray texels;
  uint width, height, format, reserved;
};
KUAFU_ARRAY(TextureArray, TextureRecord, 8)

KUAFU_CONST light_point = 1u;
KUAFU_CONST light_projector = 2u;

struct LightRecord {
  UintArray pattern;  // [height][width] relative radiant intensity of pattern_bits each, packed; projectors only
  uint width, height, pattern_bits;  // 8 and 16: 0..1 as an integer; 32: float
  vec3 position;
  uint kind;
  vec3 intensity;          // W/sr in the band being rendered
  vec3 world_to_pixel[3];  // rows of K R: homogeneous pixel of a world direction from the light
  float probability, cumulative;              // selection among all lights of the environment, by power
  float other_probability, other_cumulative;  // the same among those that are no projectors
};
KUAFU_ARRAY(LightArray, LightRecord, 8)

struct EnvironmentRecord {
  vec3 radiance;
  uint first_light, projector_count, light_count;  // projectors come first
};
KUAFU_ARRAY(EnvironmentArray, EnvironmentRecord, 4)

KUAFU_CONST specular_albedo_size = 32u;  // cosines and roughnesses of the table

struct SceneAddresses {
  InstanceArray instances;
  UintArray instance_materials;  // index into materials
  MaterialArray materials;
  TextureArray textures;
  LightArray lights;
  EnvironmentArray environments;
  Vec2Array specular_albedo;  // [roughness][cosine]
};
KUAFU_ARRAY(SceneReference, SceneAddresses, 8)

#ifdef __cplusplus
static_assert(sizeof(InstanceRecord) == 144);
static_assert(sizeof(MaterialRecord) == 88);
static_assert(sizeof(TextureRecord) == 24);
static_assert(sizeof(LightRecord) == 104);
static_assert(sizeof(EnvironmentRecord) == 24);
static_assert(sizeof(SceneAddresses) == 56);
}  // namespace kuafu
#endif
#endif
