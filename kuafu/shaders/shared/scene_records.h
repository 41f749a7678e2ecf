// The scene as shaders see it, read by GLSL and C++ (scalar layout). Tables stand in buffers whose device addresses are in SceneAddresses.
#ifndef KUAFU_SCENE_RECORDS_H
#define KUAFU_SCENE_RECORDS_H

#include "shared/ray_queue.h"

#ifdef __cplusplus
#include <glm/glm.hpp>
namespace kuafu {
using glm::vec2;
using glm::vec3;
using glm::vec4;
#define KUAFU_REFERENCE(T) uint64_t
#else
#include "lib/arrays.glsl"
#define KUAFU_REFERENCE(T) T
#endif

KUAFU_CONST instance_has_normals = 1u;
KUAFU_CONST instance_has_uvs = 2u;
KUAFU_CONST instance_has_slots = 4u;

struct InstanceRecord {
  KUAFU_REFERENCE(Vec3Array) positions;
  KUAFU_REFERENCE(Vec3Array) normals;
  KUAFU_REFERENCE(Vec2Array) uvs;
  KUAFU_REFERENCE(UVec3Array) indices;
  KUAFU_REFERENCE(UintArray) slots;
  vec4 local_to_world[3];   // rows
  vec3 normal_to_world[3];  // rows of the inverse transpose
  uint flags;               // instance_has_*
  uint first_material;      // slot s has material SceneAddresses.instance_materials[first_material + min(s, material_count)]
  uint material_count;
  uint id;
};

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

KUAFU_CONST no_texture = 0xffffffffu;
KUAFU_CONST texel_half4 = 0u;
KUAFU_CONST texel_float4 = 1u;

/// Linear RGBA texels, row 0 first.
struct TextureRecord {
  KUAFU_REFERENCE(UintArray) texels;
  uint width, height, format, reserved;
};

KUAFU_CONST light_point = 1u;
KUAFU_CONST light_projector = 2u;

struct LightRecord {
  KUAFU_REFERENCE(FloatArray) pattern;  // [height][width] relative radiant intensity, projectors only
  uint width, height;
  vec3 position;
  uint kind;
  vec3 intensity;          // W/sr in the band being rendered
  vec3 world_to_pixel[3];  // rows of K R: homogeneous pixel of a world direction from the light
  float probability, cumulative;              // selection among all lights of the environment, by power
  float other_probability, other_cumulative;  // the same among those that are no projectors
};

struct EnvironmentRecord {
  vec3 radiance;
  uint first_light, projector_count, light_count;  // projectors come first
};

KUAFU_CONST specular_albedo_size = 32u;  // cosines and roughnesses of the table

struct SceneAddresses {
  KUAFU_REFERENCE(InstanceArray) instances;
  KUAFU_REFERENCE(UintArray) instance_materials;  // index into materials
  KUAFU_REFERENCE(MaterialArray) materials;
  KUAFU_REFERENCE(TextureArray) textures;
  KUAFU_REFERENCE(LightArray) lights;
  KUAFU_REFERENCE(EnvironmentArray) environments;
  KUAFU_REFERENCE(Vec2Array) specular_albedo;  // [roughness][cosine]
};

#ifdef __cplusplus
static_assert(sizeof(InstanceRecord) == 144);
static_assert(sizeof(MaterialRecord) == 88);
static_assert(sizeof(TextureRecord) == 24);
static_assert(sizeof(LightRecord) == 96);
static_assert(sizeof(EnvironmentRecord) == 24);
static_assert(sizeof(SceneAddresses) == 56);
}  // namespace kuafu
#else
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer InstanceArray { InstanceRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer MaterialArray { MaterialRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer TextureArray { TextureRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer LightArray { LightRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer EnvironmentArray { EnvironmentRecord at[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer SceneReference { SceneAddresses at; };
#endif
#endif
