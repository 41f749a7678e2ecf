/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_API_TABLE_H
#define KUAFU_API_TABLE_H
#include <stddef.h>
#include "kuafu/kuafu.h"
#ifdef __cplusplus
extern "C" {
#endif
typedef struct kuafu_api {
  uint64_t size_bytes;
  uint32_t (*version)(void);
  const char* (*last_error)(void);
  ks_status (*device_enumerate)(ks_device_info* infos, uint32_t* count);
  ks_status (*device_create)(const ks_device_desc* desc, kuafu_device* out);
  ks_status (*device_get_info)(kuafu_device device, ks_device_info* out);
  void (*device_retain)(kuafu_device device);
  void (*device_release)(kuafu_device device);
  ks_status (*device_copied_bytes)(kuafu_device device, uint64_t* out);
  ks_status (*device_allocated_bytes)(kuafu_device device, uint64_t* out);
  ks_status (*buffer_create)(kuafu_device device, const ks_buffer_create* create, kuafu_buffer* out);
  ks_status (*buffer_import)(kuafu_device device, const ks_buffer_desc* desc, kuafu_buffer* out);
  ks_status (*buffer_export)(kuafu_buffer buffer, uint32_t memory, ks_buffer_desc* out);
  ks_status (*buffer_map)(kuafu_buffer buffer, void** out);
  ks_status (*buffer_write)(kuafu_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
  ks_status (*buffer_read)(kuafu_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
  void (*buffer_retain)(kuafu_buffer buffer);
  void (*buffer_release)(kuafu_buffer buffer);
  ks_status (*scene_create)(kuafu_device device, kuafu_scene* out);
  void (*scene_retain)(kuafu_scene scene);
  void (*scene_release)(kuafu_scene scene);
  ks_status (*scene_load)(kuafu_scene scene, const char* path, const char* name, const double* root_to_world);
  ks_status (*scene_get_summary)(kuafu_scene scene, kuafu_scene_summary* out);
  ks_status (*scene_add_mesh)(kuafu_scene scene, const kuafu_mesh_desc* desc, uint32_t* id);
  ks_status (*scene_update_mesh)(kuafu_scene scene, uint32_t id, const float* positions, const float* normals, uint32_t vertex_count);
  ks_status (*scene_add_texture)(kuafu_scene scene, const kuafu_texture_desc* desc, uint32_t* id);
  ks_status (*scene_set_texture)(kuafu_scene scene, uint32_t id, const kuafu_texture_desc* desc);
  ks_status (*scene_add_material)(kuafu_scene scene, const kuafu_material_desc* desc, uint32_t* id);
  ks_status (*scene_set_material)(kuafu_scene scene, uint32_t id, const kuafu_material_desc* desc);
  ks_status (*scene_get_material)(kuafu_scene scene, uint32_t id, kuafu_material_desc* out);
  ks_status (*scene_add_instance)(kuafu_scene scene, const kuafu_instance_desc* desc, uint32_t* id);
  ks_status (*scene_set_instance_pose)(kuafu_scene scene, uint32_t id, const double* local_to_world);
  ks_status (*scene_set_instance_velocity)(kuafu_scene scene, uint32_t id, const double* linear, const double* angular);
  ks_status (*scene_set_instance_materials)(kuafu_scene scene, uint32_t id, const uint32_t* materials, uint32_t material_count);
  ks_status (*scene_next_frame)(kuafu_scene scene);
  ks_status (*scene_remove_mesh)(kuafu_scene scene, uint32_t id);
  ks_status (*scene_remove_texture)(kuafu_scene scene, uint32_t id);
  ks_status (*scene_remove_material)(kuafu_scene scene, uint32_t id);
  ks_status (*scene_remove_instance)(kuafu_scene scene, uint32_t id);
  const char* (*scene_instance_name)(kuafu_scene scene, uint32_t id);
  const char* (*scene_material_name)(kuafu_scene scene, uint32_t id);
  ks_status (*scene_add_light)(kuafu_scene scene, const kuafu_light_desc* desc, uint32_t* id);
  ks_status (*scene_set_light)(kuafu_scene scene, uint32_t id, const kuafu_light_desc* desc);
  ks_status (*scene_get_light)(kuafu_scene scene, uint32_t id, kuafu_light_desc* out);
  ks_status (*scene_remove_light)(kuafu_scene scene, uint32_t id);
  ks_status (*scene_set_environment)(kuafu_scene scene, const kuafu_environment_desc* desc);
  ks_status (*scene_set_medium)(kuafu_scene scene, const kuafu_medium_desc* desc);
  ks_status (*scene_get_camera)(kuafu_scene scene, uint32_t index, kuafu_camera_desc* out);
  ks_status (*renderer_create)(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out);
  void (*renderer_retain)(kuafu_renderer renderer);
  void (*renderer_release)(kuafu_renderer renderer);
  ks_status (*renderer_render)(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc);
  ks_status (*renderer_get_summary)(kuafu_renderer renderer, kuafu_render_summary* out);
  ks_status (*renderer_get_stage_times)(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count);
  ks_status (*struct_init)(uint32_t type, void* out, uint32_t size_bytes);
  ks_status (*renderer_submit)(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc, ks_sync* out);
  ks_status (*renderer_wait)(kuafu_renderer renderer, const ks_sync* sync, uint64_t timeout_ns);
  ks_status (*renderer_cancel)(kuafu_renderer renderer);
  ks_status (*scene_cancel_load)(kuafu_scene scene);
  ks_status (*scene_set_instance_poses)(kuafu_scene scene, const uint32_t* ids, const double* local_to_world, uint32_t count);
  ks_status (*scene_set_lights)(kuafu_scene scene, const uint32_t* ids, const kuafu_light_desc* descs, uint32_t count);
  ks_status (*renderer_export_timeline)(kuafu_renderer renderer, ks_sync* out);
  ks_status (*scene_animate)(kuafu_scene scene, uint32_t animation, double time_s);
  ks_status (*scene_animation_duration)(kuafu_scene scene, uint32_t animation, double* out);
  const char* (*scene_animation_name)(kuafu_scene scene, uint32_t animation);
  ks_status (*renderer_light_gbuffers)(kuafu_renderer renderer, kuafu_scene scene, const kuafu_gbuffer_desc* desc);
} kuafu_api;
#define KUAFU_API_HAS(api, entry) ((api)->size_bytes >= offsetof(kuafu_api, entry) + sizeof((api)->entry))
KUAFU_API const kuafu_api* kuafu_get_api(void);
typedef const kuafu_api* (*kuafu_get_api_fn)(void);
#ifdef __cplusplus
}
#endif
#endif
