/* SPDX-License-Identifier: Apache-2.0 */
#ifndef KUAFU_KUAFU_H
#define KUAFU_KUAFU_H
#include <math.h>
#include <stdint.h>
#include <string.h>
#include "ks/buffer.h"
#include "ks/device.h"
#include "ks/header.h"
#include "ks/image.h"
#include "ks/log.h"
#include "ks/status.h"
#include "ks/sync.h"
#include "kuafu/camera.h"
#include "kuafu/geometry.h"
#include "kuafu/light.h"
#include "kuafu/material.h"
#include "kuafu/medium.h"
#include "kuafu/optics.h"
#include "kuafu/output.h"
#include "kuafu/render.h"
#include "kuafu/gbuffer.h"
#define KUAFU_VERSION_MAJOR 0
#define KUAFU_VERSION_MINOR 2
#define KUAFU_VERSION_PATCH 0
#if defined(__GNUC__)
#define KUAFU_API __attribute__((visibility("default")))
#else
#define KUAFU_API
#endif
#ifdef __cplusplus
extern "C" {
#endif
typedef struct kuafu_device_t* kuafu_device;
typedef struct kuafu_scene_t* kuafu_scene;
typedef struct kuafu_renderer_t* kuafu_renderer;
KUAFU_API uint32_t kuafu_version(void);
KUAFU_API ks_status kuafu_struct_init(uint32_t type, void* out, uint32_t size_bytes);
KUAFU_API const char* kuafu_last_error(void);
KUAFU_API ks_status kuafu_device_enumerate(ks_device_info* infos, uint32_t* count);
KUAFU_API ks_status kuafu_device_create(const ks_device_desc* desc, kuafu_device* out);
KUAFU_API ks_status kuafu_device_get_info(kuafu_device device, ks_device_info* out);
KUAFU_API void kuafu_device_retain(kuafu_device device);
KUAFU_API void kuafu_device_release(kuafu_device device);
KUAFU_API ks_status kuafu_device_copied_bytes(kuafu_device device, uint64_t* out);
KUAFU_API ks_status kuafu_device_allocated_bytes(kuafu_device device, uint64_t* out);
KUAFU_API ks_status kuafu_buffer_create(kuafu_device device, const ks_buffer_create* create, kuafu_buffer* out);
KUAFU_API ks_status kuafu_buffer_import(kuafu_device device, const ks_buffer_desc* desc, kuafu_buffer* out);
KUAFU_API ks_status kuafu_buffer_export(kuafu_buffer buffer, uint32_t memory, ks_buffer_desc* out);
KUAFU_API ks_status kuafu_buffer_map(kuafu_buffer buffer, void** out);
KUAFU_API ks_status kuafu_buffer_write(kuafu_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
KUAFU_API ks_status kuafu_buffer_read(kuafu_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
KUAFU_API void kuafu_buffer_retain(kuafu_buffer buffer);
KUAFU_API void kuafu_buffer_release(kuafu_buffer buffer);
KUAFU_API ks_status kuafu_scene_create(kuafu_device device, kuafu_scene* out);
KUAFU_API void kuafu_scene_retain(kuafu_scene scene);
KUAFU_API void kuafu_scene_release(kuafu_scene scene);
KUAFU_API ks_status kuafu_scene_load(kuafu_scene scene, const char* path, const char* name, const double* root_to_world);
KUAFU_API ks_status kuafu_scene_cancel_load(kuafu_scene scene);
#define KUAFU_ALL_ANIMATIONS 0xffffffffu
KUAFU_API ks_status kuafu_scene_animate(kuafu_scene scene, uint32_t animation, double time_s);
KUAFU_API ks_status kuafu_scene_animation_duration(kuafu_scene scene, uint32_t animation, double* out);
KUAFU_API const char* kuafu_scene_animation_name(kuafu_scene scene, uint32_t animation);
KUAFU_API ks_status kuafu_scene_get_summary(kuafu_scene scene, kuafu_scene_summary* out);
KUAFU_API ks_status kuafu_scene_add_mesh(kuafu_scene scene, const kuafu_mesh_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_update_mesh(kuafu_scene scene, uint32_t id, const float* positions, const float* normals, uint32_t vertex_count);
KUAFU_API ks_status kuafu_scene_add_texture(kuafu_scene scene, const kuafu_texture_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_texture(kuafu_scene scene, uint32_t id, const kuafu_texture_desc* desc);
KUAFU_API ks_status kuafu_scene_add_material(kuafu_scene scene, const kuafu_material_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_material(kuafu_scene scene, uint32_t id, const kuafu_material_desc* desc);
KUAFU_API ks_status kuafu_scene_get_material(kuafu_scene scene, uint32_t id, kuafu_material_desc* out);
KUAFU_API ks_status kuafu_scene_add_instance(kuafu_scene scene, const kuafu_instance_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_instance_pose(kuafu_scene scene, uint32_t id, const double* local_to_world);
KUAFU_API ks_status kuafu_scene_set_instance_poses(kuafu_scene scene, const uint32_t* ids, const double* local_to_world, uint32_t count);
KUAFU_API ks_status kuafu_scene_set_instance_velocity(kuafu_scene scene, uint32_t id, const double* linear, const double* angular);
KUAFU_API ks_status kuafu_scene_set_instance_materials(kuafu_scene scene, uint32_t id, const uint32_t* materials, uint32_t material_count);
KUAFU_API ks_status kuafu_scene_next_frame(kuafu_scene scene);
KUAFU_API ks_status kuafu_scene_remove_mesh(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_texture(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_material(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_instance(kuafu_scene scene, uint32_t id);
KUAFU_API const char* kuafu_scene_instance_name(kuafu_scene scene, uint32_t id);
KUAFU_API const char* kuafu_scene_material_name(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_add_light(kuafu_scene scene, const kuafu_light_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_light(kuafu_scene scene, uint32_t id, const kuafu_light_desc* desc);
KUAFU_API ks_status kuafu_scene_set_lights(kuafu_scene scene, const uint32_t* ids, const kuafu_light_desc* descs, uint32_t count);
KUAFU_API ks_status kuafu_scene_get_light(kuafu_scene scene, uint32_t id, kuafu_light_desc* out);
KUAFU_API ks_status kuafu_scene_remove_light(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_set_environment(kuafu_scene scene, const kuafu_environment_desc* desc);
KUAFU_API ks_status kuafu_scene_set_medium(kuafu_scene scene, const kuafu_medium_desc* desc);
KUAFU_API ks_status kuafu_scene_get_camera(kuafu_scene scene, uint32_t index, kuafu_camera_desc* out);
KUAFU_API ks_status kuafu_renderer_create(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out);
KUAFU_API void kuafu_renderer_retain(kuafu_renderer renderer);
KUAFU_API void kuafu_renderer_release(kuafu_renderer renderer);
KUAFU_API ks_status kuafu_renderer_render(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc);
KUAFU_API ks_status kuafu_renderer_submit(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc, ks_sync* out);
KUAFU_API ks_status kuafu_renderer_wait(kuafu_renderer renderer, const ks_sync* sync, uint64_t timeout_ns);
KUAFU_API ks_status kuafu_renderer_cancel(kuafu_renderer renderer);
KUAFU_API ks_status kuafu_renderer_export_timeline(kuafu_renderer renderer, ks_sync* out);
KUAFU_API ks_status kuafu_renderer_light_gbuffers(kuafu_renderer renderer, kuafu_scene scene, const kuafu_gbuffer_desc* desc);
KUAFU_API ks_status kuafu_renderer_get_summary(kuafu_renderer renderer, kuafu_render_summary* out);
KUAFU_API ks_status kuafu_renderer_get_stage_times(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count);
#ifdef __cplusplus
}
#endif
#endif
