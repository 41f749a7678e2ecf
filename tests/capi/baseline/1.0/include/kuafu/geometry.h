/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_GEOMETRY_H
#define KUAFU_GEOMETRY_H
#include <stdint.h>
#include <string.h>
#include "ks/header.h"
#include "kuafu/light.h"
#ifdef __cplusplus
extern "C" {
#endif
#define KUAFU_TYPE_SCENE_SUMMARY 0x100bu
#define KUAFU_TYPE_MESH_DESC 0x1001u
#define KUAFU_TYPE_TEXTURE_DESC 0x1002u
#define KUAFU_WRAP_REPEAT 0u
#define KUAFU_WRAP_CLAMP 1u
#define KUAFU_WRAP_MIRROR 2u
#define KUAFU_FILTER_LINEAR 0u
#define KUAFU_FILTER_NEAREST 1u
#define KUAFU_TYPE_INSTANCE_DESC 0x1004u
typedef struct kuafu_scene_summary {
  ks_header header;
  uint32_t mesh_count;
  uint32_t texture_count;
  uint32_t material_count;
  uint32_t instance_count;
  uint32_t light_count;
  uint32_t camera_count;
  uint32_t animation_count;
  uint32_t reserved;
  uint64_t triangle_count;
  double bounds_min_m[3];
  double bounds_max_m[3];
} kuafu_scene_summary;
static inline kuafu_scene_summary kuafu_scene_summary_init(void) {
  kuafu_scene_summary s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_SCENE_SUMMARY, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct kuafu_mesh_desc {
  ks_header header;
  const char* name;
  const float* positions;
  const float* normals;
  const float* uvs;
  const float* uvs_1;
  const float* colors;
  const uint32_t* indices;
  const uint32_t* slots;
  uint32_t vertex_count;
  uint32_t triangle_count;
} kuafu_mesh_desc;
static inline kuafu_mesh_desc kuafu_mesh_desc_init(void) {
  kuafu_mesh_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_MESH_DESC, KS_CAST(uint32_t, sizeof s));
  return s;
}
typedef struct kuafu_texture_desc {
  ks_header header;
  const char* name;
  const void* texels;
  uint32_t width;
  uint32_t height;
  uint32_t channels;
  uint32_t format;
  uint32_t srgb;
  uint32_t wrap_u;
  uint32_t wrap_v;
  uint32_t filter;
  uint32_t uv_set;
  float uv_transform[6];
  uint32_t reserved;
} kuafu_texture_desc;
static inline kuafu_texture_desc kuafu_texture_desc_init(void) {
  kuafu_texture_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_TEXTURE_DESC, KS_CAST(uint32_t, sizeof s));
  s.channels = 1u;
  return s;
}
typedef struct kuafu_instance_desc {
  ks_header header;
  const char* name;
  uint32_t mesh;
  uint32_t environment;
  const uint32_t* materials;
  uint32_t material_count;
  uint32_t semantic_id;
  double local_to_world[16];
  double linear_velocity[3];
  double angular_velocity[3];
} kuafu_instance_desc;
static inline kuafu_instance_desc kuafu_instance_desc_init(uint32_t mesh) {
  kuafu_instance_desc s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_INSTANCE_DESC, KS_CAST(uint32_t, sizeof s));
  s.mesh = mesh;
  s.environment = KUAFU_ALL_ENVIRONMENTS;
  s.local_to_world[0] = 1.0;
  s.local_to_world[5] = 1.0;
  s.local_to_world[10] = 1.0;
  s.local_to_world[15] = 1.0;
  return s;
}
#ifdef __cplusplus
}
#endif
#endif
