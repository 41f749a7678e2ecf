// SPDX-License-Identifier: Apache-2.0
// The scene as shaders see it, read by GLSL and C++ (scalar layout). Tables stand in buffers whose device addresses are in SceneAddresses.
#ifndef KUAFU_SCENE_RECORDS_H
#define KUAFU_SCENE_RECORDS_H

#include "shared/arrays.h"
#include "shared/light_fields.h"
#include "shared/material_fields.h"
#include "shared/motion_record.h"
#include "shared/ray_queue.h"

#ifdef __cplusplus
namespace kuafu {
#endif

KUAFU_CONST instance_has_normals = 1u;
KUAFU_CONST instance_has_uvs = 2u;
KUAFU_CONST instance_has_slots = 4u;
KUAFU_CONST instance_has_uvs_1 = 8u;
KUAFU_CONST instance_has_colors = 16u;
KUAFU_CONST instance_has_tangents = 32u;

struct InstanceRecord {
  Vec3Array positions;
  Vec3Array normals;
  Vec2Array uvs, uvs_1;
  Vec4Array colors, tangents;
  UVec3Array indices;
  UintArray slots;
  vec4 local_to_world[3];   // rows
  vec3 normal_to_world[3];  // rows of the inverse transpose
  uint flags;               // instance_has_*
  uint first_material;      // slot s has material SceneAddresses.instance_materials[first_material + min(s, material_count)]
  uint material_count;
  uint id;
  uint semantic_id;
};
KUAFU_ARRAY(InstanceArray, InstanceRecord, 8)

KUAFU_CONST alpha_opaque = 0u;
KUAFU_CONST alpha_mask = 1u;
KUAFU_CONST alpha_blend = 2u;

// What asks whether a surface is there (lib/cutout.glsl): the nearest hit, or a shadow ray.
KUAFU_CONST cutout_closest = 0u;
KUAFU_CONST cutout_occluded = 1u;

KUAFU_CONST no_texture = 0xffffffffu;
KUAFU_CONST texel_half4 = 0u;
KUAFU_CONST texel_float4 = 1u;

// TextureRecord.lookup: 0 is linear, repeating, at the mesh's first texture coordinates as they are. Bits 0 and 1: wrap_* of u; 2 and 3: of
// v.
KUAFU_CONST wrap_repeat = 0u;
KUAFU_CONST wrap_clamp = 1u;
KUAFU_CONST wrap_mirror = 2u;
KUAFU_CONST lookup_wrap_mask = 3u;
KUAFU_CONST lookup_wrap_v_shift = 2u;
KUAFU_CONST lookup_nearest = 1u << 4u;
KUAFU_CONST lookup_uv_1 = 1u << 5u;
KUAFU_CONST lookup_transform = 1u << 6u;

/// Linear RGBA texels, row 0 first.
struct TextureRecord {
  UintArray texels;
  uint width, height, format, lookup;
  vec3 transform[2];  // rows, from a mesh's texture coordinates (u, v, 1) to the image's
};
KUAFU_ARRAY(TextureArray, TextureRecord, 8)

KUAFU_CONST light_point = 1u;
KUAFU_CONST light_projector = 2u;
KUAFU_CONST light_directional = 3u;
KUAFU_CONST light_spot = 4u;
KUAFU_CONST light_rectangle = 5u;
KUAFU_CONST light_disk = 6u;
KUAFU_CONST light_mesh = 7u;  // all emissive surfaces of an environment
KUAFU_CONST light_map = 8u;   // the environment's texture

struct LightRecord {
  UintArray pattern;                 // [height][width] relative radiant intensity of pattern_bits each, packed; projectors only
  uint width, height, pattern_bits;  // 8 and 16: 0..1 as an integer; 32: float
  vec3 position;
  uint kind;
  vec3 intensity;  // in the band being rendered: W/sr (point, spot, projector), W/m^2 (directional) or W/(sr m^2) (those with an area)
  vec3 world_to_pixel[3];                     // rows of K R: homogeneous pixel of a world direction from the light
  float probability, cumulative;              // selection among all lights of the environment, by power
  float other_probability, other_cumulative;  // the same among those that are no projectors
  uint light_group;                           // not of a projector; light_mesh has those of its materials
};
KUAFU_ARRAY(LightArray, LightRecord, 8)

/// What a light does in time; read only with feature_motion.
struct LightMotion {
  MotionRecord motion;
  float on_from_s, on_until_s;  // equal: always
};
KUAFU_ARRAY(LightMotionArray, LightMotion, 4)

struct EnvironmentRecord {
  vec3 radiance;
  uint first_light, projector_count, light_count;  // projectors come first
  uint first_shape;                                // from here to the end: lights that rays meet; counted from first_light
  uint mesh_light;                                 // index into lights, or miss
  uint light_group;                                // of the radiance
};
KUAFU_ARRAY(EnvironmentArray, EnvironmentRecord, 4)

KUAFU_CONST specular_albedo_size = 32u;  // cosines and roughnesses of metal's table, which means over the hemisphere follow
KUAFU_CONST layer_albedo_size = 16u;     // indices and roughnesses of the layer's
KUAFU_CONST layer_albedo_first = 32u * 33u;
KUAFU_CONST specular_albedo_entries = 32u * 33u + 16u * 16u * 32u;
KUAFU_CONST sheen_albedo_first = 32u * 33u + 16u * 16u * 32u;  // filled where a scene has sheen
KUAFU_CONST sheen_albedo_roughnesses = 16u;
KUAFU_CONST sheen_albedo_entries = 16u * 32u;
KUAFU_CONST sheen_least_percent = 7u;                                      // the least roughness of sheen that is told apart
KUAFU_CONST glass_albedo_first = 32u * 33u + 16u * 16u * 32u + 16u * 32u;  // where a scene has rough glass
KUAFU_CONST glass_albedo_indices = 20u;
KUAFU_CONST glass_albedo_roughnesses = 24u;
KUAFU_CONST glass_albedo_cosines = 24u;

/// In the band being rendered, the infrared in x.
struct MediumRecord {
  vec3 extinction;  // 1/m
  vec3 albedo;      // share of it that is scattered
  float phase_g;
  vec3 bounds_min, bounds_max;  // world, metres
  float housing_m;              // before a camera there is none of it
};
KUAFU_ARRAY(MediumArray, MediumRecord, 4)

struct SceneAddresses {
  InstanceArray instances;
  UintArray instance_materials;  // index into materials
  MaterialArray materials;
  TextureArray textures;
  LightArray lights;
  EnvironmentArray environments;
  Vec2Array specular_albedo;     // material/albedo_tables.h
  LightShapeArray light_shapes;  // as lights
  FloatArray light_cumulative;
  UintArray light_triangles;       // instance and primitive
  MediumArray medium;              // one, where there is one
  MotionArray instance_motions;    // as instances; filled where something moves
  LightMotionArray light_motions;  // as lights
  uint moves;                      // nonzero: an instance or a light moves or goes on or off while a shutter is open
  uint reserved;
};
KUAFU_ARRAY(SceneReference, SceneAddresses, 8)

#ifdef __cplusplus
static_assert(sizeof(InstanceRecord) == 168);
static_assert(sizeof(TextureRecord) == 48);
static_assert(sizeof(LightRecord) == 104);
static_assert(sizeof(EnvironmentRecord) == 36);
static_assert(sizeof(MediumRecord) == 56);
static_assert(sizeof(SceneAddresses) == 112);
}  // namespace kuafu
#endif
#endif
