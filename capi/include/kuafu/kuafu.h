/* SPDX-License-Identifier: Apache-2.0 */
/* kuafu: a path tracer for active stereo cameras, which project an infrared pattern. It runs on any Vulkan device. C99.
 *
 * Conventions: lengths are in metres, angles in radians, times in seconds. In a camera's frame x points right, y down and z forward. Pixel centres lie at
 * integers, and depth is z. A 4x4 transform is row-major and named a_to_b: it maps coordinates in a to coordinates in b.
 * Errors: every function that can fail returns ks_status. kuafu_last_error() is the thread's last message, with the numbers and what to do. A failed call
 * leaves its objects as they were.
 * Ids: meshes, textures, materials, instances and lights are counted from 1 in the order in which they came; 0 is none.
 * Lifetime: a create function returns one reference, ..._retain takes another, and ..._release gives one back; ..._release(NULL) does nothing. An object
 * keeps those that it was made from, so that they may be released in any order.
 * Time: time 0 is the middle of the exposure of a view's middle line. If P is an object's pose at time 0 and [v, w] its twist, its pose at time t is
 * P exp(t [v, w]), where v (m/s) and w (rad/s) are in the object's own frame. Motion within an exposure, or from line to line, is rendered
 * where a camera's exposure_s or line_time_s is not 0.
 * Threads: a device may be used by several threads at once, a scene and a renderer by one thread at a time. A render, or a change of a scene, inside
 * another call is refused with KS_ERROR_INVALID_STATE. Distinct objects are independent. */
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

/* Version of the library, packed as major * 10000 + minor * 100 + patch. */
KUAFU_API uint32_t kuafu_version(void);
/* Fills in the header and the defaults of any struct, as the struct's inline ..._init does. `type` is the struct's ..._TYPE_... and size_bytes its size in
 * the caller's program. It is meant for languages that do not read C headers. */
KUAFU_API ks_status kuafu_struct_init(uint32_t type, void* out, uint32_t size_bytes);
/* Message of this thread's last kuafu call that failed, never NULL. The text is valid until the thread's next kuafu call. */
KUAFU_API const char* kuafu_last_error(void);

/* ---- device ---------------------------------------------------------------------------------------------------------------- */

/* Lists every Vulkan device. Those that the library cannot use are included; their info.refused says why. On entry *count is the capacity of infos, on
 * return the number of devices. infos may be NULL to ask for that number. Without a Vulkan loader or driver the call returns KS_OK with *count = 0 and the
 * reason in kuafu_last_error(). */
KUAFU_API ks_status kuafu_device_enumerate(ks_device_info* infos, uint32_t* count);
/* Opens a device; desc NULL means KS_SELECT_AUTO. The message of KS_ERROR_NO_DEVICE names every device, why it was refused, and what to install. */
KUAFU_API ks_status kuafu_device_create(const ks_device_desc* desc, kuafu_device* out);
KUAFU_API ks_status kuafu_device_get_info(kuafu_device device, ks_device_info* out);
KUAFU_API void kuafu_device_retain(kuafu_device device);
KUAFU_API void kuafu_device_release(kuafu_device device);
/* Number of bytes that the library has copied between buffers, or between host memory and buffers, since the device was created. It does not grow in a
 * program that shares its images without copies. */
KUAFU_API ks_status kuafu_device_copied_bytes(kuafu_device device, uint64_t* out);
/* Number of bytes that the device's buffers hold now, including those of renderers and scenes. */
KUAFU_API ks_status kuafu_device_allocated_bytes(kuafu_device device, uint64_t* out);
/* Lends the library's VkDevice and its queue to another library: *out is what ks_device_desc.vulkan takes. Two libraries on one VkDevice
 * spare the GPU a change of context between their submissions. Release everything made from the borrower's device before `device`.
 * KS_ERROR_INVALID_STATE where the VkDevice is the host's, KS_ERROR_UNSUPPORTED where there is none. */
KUAFU_API ks_status kuafu_device_lend(kuafu_device device, ks_vulkan_device* out);

/* ---- buffer ---------------------------------------------------------------------------------------------------------------- */

KUAFU_API ks_status kuafu_buffer_create(kuafu_device device, const ks_buffer_create_desc* create, kuafu_buffer* out);
KUAFU_API ks_status kuafu_buffer_import(kuafu_device device, const ks_buffer_desc* desc, kuafu_buffer* out);
/* Describes the buffer's memory for an import by another library; memory is KS_MEMORY_*. The caller closes the file descriptor, if there is one. */
KUAFU_API ks_status kuafu_buffer_export(kuafu_buffer buffer, uint32_t memory, ks_buffer_desc* out);
/* Returns the host address of a buffer that was created with KS_BUFFER_HOST_VISIBLE. It is valid as long as the buffer lives. */
KUAFU_API ks_status kuafu_buffer_map(kuafu_buffer buffer, void** out);
KUAFU_API ks_status kuafu_buffer_write(kuafu_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
KUAFU_API ks_status kuafu_buffer_read(kuafu_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
KUAFU_API void kuafu_buffer_retain(kuafu_buffer buffer);
KUAFU_API void kuafu_buffer_release(kuafu_buffer buffer);

/* ---- scene ----------------------------------------------------------------------------------------------------------------- */

KUAFU_API ks_status kuafu_scene_create(kuafu_device device, kuafu_scene* out);
KUAFU_API void kuafu_scene_retain(kuafu_scene scene);
KUAFU_API void kuafu_scene_release(kuafu_scene scene);

/* Adds the contents of a file to the scene: meshes, materials, textures, lights (KHR_lights_punctual) and cameras of .gltf and .glb files; meshes and
 * materials of all other formats. root_to_world is a row-major 4x4 transform that is applied to every node; NULL is the identity. An error
 * names the file and the field, and the scene is then unchanged. Contents that the renderer ignores, such as unknown extensions, are reported to the
 * device's log as a warning. A light's candela and lux are divided by 683 lm/W; its extras may have ir_intensity and ir_share (kuafu_light_desc). kuafu/import/README.md says what of each format is read. A glTF
 * material may have further fields in its extras (kuafu_material_desc). name is what messages call the file, for a copy of the user's; NULL is path. Nodes, skins and morph targets stand as they do without animation, until
 * kuafu_scene_animate is called. */
KUAFU_API ks_status kuafu_scene_load(kuafu_scene scene, const char* path, const char* name, const double* root_to_world);

/* Ends a load that another thread is in: it gives KS_ERROR_CANCELLED soon, and the scene is unchanged. Any thread may call it at any time. */
KUAFU_API ks_status kuafu_scene_cancel_load(kuafu_scene scene);

/* Poses what loaded glTF files animate (glTF 2.0 section 3.11) as it is at time_s: instances, lights and cameras of animated nodes, and the vertices of meshes
 * with skins or morph targets, as the functions of this interface that move them would. animation is less than animation_count of the summary, in the order
 * of the files; what this animation does not move stands as its file has it without animation, whatever was posed before. KUAFU_ALL_ANIMATIONS stands for all
 * animations of all files; where two of them move the same property, the first one counts. Before its first keyframe and after its last an animation stands
 * still: for one that repeats, time_s is a remainder of kuafu_scene_animation_duration. time_s is finite. Objects that were removed are passed over. A node
 * that has a scale of 0 is hidden. An error, as where a vertex would have no finite place, leaves the scene as it was. */
#define KUAFU_ALL_ANIMATIONS 0xffffffffu
KUAFU_API ks_status kuafu_scene_animate(kuafu_scene scene, uint32_t animation, double time_s);
/* Time of the last keyframe, in seconds. */
KUAFU_API ks_status kuafu_scene_animation_duration(kuafu_scene scene, uint32_t animation, double* out);
/* Name of an animation, as kuafu_scene_instance_name returns names. */
KUAFU_API const char* kuafu_scene_animation_name(kuafu_scene scene, uint32_t animation);

KUAFU_API ks_status kuafu_scene_get_summary(kuafu_scene scene, kuafu_scene_summary* out);

KUAFU_API ks_status kuafu_scene_add_mesh(kuafu_scene scene, const kuafu_mesh_desc* desc, uint32_t* id);
/* A mesh, texture or instance as its add function took it, or as a loaded file has it; an instance without its velocity. Arrays and names are the scene's
 * own: they are valid until the scene changes, an instance's materials until the next call of kuafu_scene_get_instance too. */
KUAFU_API ks_status kuafu_scene_get_mesh(kuafu_scene scene, uint32_t id, kuafu_mesh_desc* out);
KUAFU_API ks_status kuafu_scene_get_texture(kuafu_scene scene, uint32_t id, kuafu_texture_desc* out);
KUAFU_API ks_status kuafu_scene_get_instance(kuafu_scene scene, uint32_t id, kuafu_instance_desc* out);
/* Moves the vertices of a mesh, for deforming bodies; its triangles, uvs and slots stay. positions is [vertex_count][3] in metres, with as many vertices as
 * the mesh has. normals is [vertex_count][3] of unit vectors where the mesh was made with normals, else NULL. The cost depends on the size of the mesh, not
 * on that of the scene. */
KUAFU_API ks_status kuafu_scene_update_mesh(kuafu_scene scene, uint32_t id, const float* positions, const float* normals, uint32_t vertex_count);

KUAFU_API ks_status kuafu_scene_add_texture(kuafu_scene scene, const kuafu_texture_desc* desc, uint32_t* id);
/* Replaces a texture, for example in every frame. Materials, lights and the environment that use it show the new one. Size, channels and format may
 * change. The cost depends on the size of the texture, not on that of the scene; for the environment's map the table of directions by brightness is made again. */
KUAFU_API ks_status kuafu_scene_set_texture(kuafu_scene scene, uint32_t id, const kuafu_texture_desc* desc);

KUAFU_API ks_status kuafu_scene_add_material(kuafu_scene scene, const kuafu_material_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_material(kuafu_scene scene, uint32_t id, const kuafu_material_desc* desc);
KUAFU_API ks_status kuafu_scene_get_material(kuafu_scene scene, uint32_t id, kuafu_material_desc* out);

KUAFU_API ks_status kuafu_scene_add_instance(kuafu_scene scene, const kuafu_instance_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_instance_pose(kuafu_scene scene, uint32_t id, const double* local_to_world);
/* Moves instances ids[count] to local_to_world[count][16], row-major, as many calls of kuafu_scene_set_instance_pose would; of an instance that is named twice
 * the last pose counts. Where one is refused, none has moved. */
KUAFU_API ks_status kuafu_scene_set_instance_poses(kuafu_scene scene, const uint32_t* ids, const double* local_to_world, uint32_t count);
/* linear and angular are the vectors [3] of kuafu_instance_desc. The call does not move the instance: the velocity says how it moves while a shutter is
 * open. */
KUAFU_API ks_status kuafu_scene_set_instance_velocity(kuafu_scene scene, uint32_t id, const double* linear, const double* angular);
KUAFU_API ks_status kuafu_scene_set_instance_materials(kuafu_scene scene, uint32_t id, const uint32_t* materials, uint32_t material_count);
/* Begins a new frame: motion vectors of later renders start from the poses that the instances have now. */
KUAFU_API ks_status kuafu_scene_next_frame(kuafu_scene scene);
/* Removes an object. Ids are never used again, and later calls with the id of a removed object fail. The object's memory is freed, on the device by the
 * next render; four bytes remain for the id. An object that another one uses cannot be removed (a mesh or a material of an instance, a texture of
 * a material, a light or the environment): the message names the object that uses it. */
KUAFU_API ks_status kuafu_scene_remove_mesh(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_texture(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_material(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_instance(kuafu_scene scene, uint32_t id);

/* Name of an instance or material, for the ids that the AOVs contain. The pointer is valid until the scene changes. NULL is returned for an id that does not
 * exist, and kuafu_last_error() then has the reason. */
KUAFU_API const char* kuafu_scene_instance_name(kuafu_scene scene, uint32_t id);
KUAFU_API const char* kuafu_scene_material_name(kuafu_scene scene, uint32_t id);

KUAFU_API ks_status kuafu_scene_add_light(kuafu_scene scene, const kuafu_light_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_light(kuafu_scene scene, uint32_t id, const kuafu_light_desc* desc);
/* Replaces lights ids[count] by descs[count], as many calls of kuafu_scene_set_light would. Where one is refused, none has changed. */
KUAFU_API ks_status kuafu_scene_set_lights(kuafu_scene scene, const uint32_t* ids, const kuafu_light_desc* descs, uint32_t count);
KUAFU_API ks_status kuafu_scene_get_light(kuafu_scene scene, uint32_t id, kuafu_light_desc* out);
KUAFU_API ks_status kuafu_scene_remove_light(kuafu_scene scene, uint32_t id);

KUAFU_API ks_status kuafu_scene_set_environment(kuafu_scene scene, const kuafu_environment_desc* desc);

/* Sets the medium that fills the scene. desc NULL means none, as in a new scene. */
KUAFU_API ks_status kuafu_scene_set_medium(kuafu_scene scene, const kuafu_medium_desc* desc);

/* Returns a camera of a loaded file. index is less than camera_count of the summary and follows the order of the file's nodes. camera_to_world uses the
 * axes of this interface, not those of the file. A file's camera has no number of pixels: width and height are 0, and k describes an image of height 1 whose
 * origin is its top left corner, so that 2 k[2] is the aspect ratio (1 where the file states none). For an image of H rows: fx = H k[0], cx = H k[2] - 0.5,
 * fy = H k[4], cy = H k[5] - 0.5 (pixel centres at integers), and W = 2 H k[2]. */
KUAFU_API ks_status kuafu_scene_get_camera(kuafu_scene scene, uint32_t index, kuafu_camera_desc* out);

/* ---- rendering ------------------------------------------------------------------------------------------------------------- */

KUAFU_API ks_status kuafu_renderer_create(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out);
KUAFU_API void kuafu_renderer_retain(kuafu_renderer renderer);
KUAFU_API void kuafu_renderer_release(kuafu_renderer renderer);

/* Renders, and returns when the outputs may be read (KS_SYNC_HOST). The same inputs and seed give the same bits on one device, for any number of threads
 * and however a batch is split. The scene may have been made on another device than the renderer, for it lies in host memory, and each renderer brings a
 * copy of its own to its device; the outputs' buffers must be of the renderer's device (else KS_ERROR_INVALID_ARGUMENT). */
KUAFU_API ks_status kuafu_renderer_render(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc);
/* Starts a render and returns at once. The renders of one renderer run in the order of their submissions on a thread of the library, which also calls
 * desc->progress. `desc` is copied. Until the render has ended, the outputs must not be read, and functions that change the scene return
 * KS_ERROR_INVALID_STATE. The caller initialises `out`, which kuafu_renderer_wait then takes. Two submissions may be under way; a third call waits for the
 * first one. */
KUAFU_API ks_status kuafu_renderer_submit(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc, ks_sync* out);
/* Waits until the outputs of a submission may be read, and returns the status of its render. KS_ERROR_TIMEOUT means that the render has not ended after
 * timeout_ns; it continues and may be waited for again. A timeout of 0 does not wait, UINT64_MAX waits as long as necessary. The status of a render is kept
 * until the second submission after it. */
KUAFU_API ks_status kuafu_renderer_wait(kuafu_renderer renderer, const ks_sync* sync, uint64_t timeout_ns);
/* Cancels the renders of this renderer, both submitted ones and one in a call of another thread. They end with KS_ERROR_CANCELLED, within 0.2 s on an idle
 * machine. Any thread may call it at any time. Releasing a renderer also cancels its renders, and waits until they have ended. */
KUAFU_API ks_status kuafu_renderer_cancel(kuafu_renderer renderer);
/* Returns a timeline semaphore for waits on the device, with the value of the last submission. It takes a submission's value when that render has ended,
 * whether it succeeded or failed. On a device that the host has made it is a KS_SYNC_SEMAPHORE, which lives as long as the renderer; elsewhere a
 * KS_SYNC_TIMELINE_FD, whose file descriptor the caller closes and for which the device needs KS_CAP_TIMELINE_FD. */
KUAFU_API ks_status kuafu_renderer_export_timeline(kuafu_renderer renderer, ks_sync* out);

/* Renders infrared pairs of surfaces that another renderer saw: their light after one reflection by the scene's materials of its first projector's
 * light, through the same patterns, beams and optics as a render's, and of the room's light as far as the images show what stands in its way. Nothing else
 * of the scene counts. Images with a value that cannot be give KS_ERROR_INVALID_ARGUMENT, which names environment, pixel and value; the outputs' contents
 * are then undefined. */
KUAFU_API ks_status kuafu_renderer_light_gbuffers(kuafu_renderer renderer, kuafu_scene scene, const kuafu_gbuffer_desc* desc);

/* Summary of the last render that succeeded. */
KUAFU_API ks_status kuafu_renderer_get_summary(kuafu_renderer renderer, kuafu_render_summary* out);
/* Times of the last render's stages. On entry *count is the capacity of times, on return the number of stages. times may be NULL. */
KUAFU_API ks_status kuafu_renderer_get_stage_times(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count);

#ifdef __cplusplus
}
#endif

#endif
