/* kuafu: a Vulkan path tracer for active stereo (infrared pattern projectors). C99.
 *
 * Conventions: metres, radians, seconds. Camera frame: x right, y down, z forward; pixel centres at integers; depth is z.
 * A 4x4 transform is row-major and named a_to_b: it maps coordinates in a to coordinates in b.
 * Errors: every call that can fail returns ks_status; kuafu_last_error() is the thread's last message, with the numbers and what to do.
 * Lifetime: create returns one reference; retain/release; release(NULL) is a no-op; a child keeps its parents, so any release order is legal.
 * Time: 0 is mid-exposure of a view's middle line. Poses are those of time 0; what has a twist [v, w] is at pose exp(t [v, w]) at time t, v (m/s) and
 * w (rad/s) being in its own frame. Motion within an exposure, or from line to line, is rendered where a camera's exposure_s or line_time_s is not 0.
 * Threads: a device is internally synchronised; a scene and a renderer are used by one thread at a time; distinct objects are independent. */
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
#include "kuafu/optics.h"
#include "kuafu/geometry.h"
#include "kuafu/light.h"
#include "kuafu/material.h"
#include "kuafu/medium.h"
#include "kuafu/output.h"
#include "kuafu/render.h"

#define KUAFU_VERSION_MAJOR 0
#define KUAFU_VERSION_MINOR 1
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

/* Packed as major * 10000 + minor * 100 + patch. */
KUAFU_API uint32_t kuafu_version(void);
/* Fills in the header and the defaults of any struct, as its inline ..._init does: type is the struct's ..._TYPE_..., size_bytes its sizeof where the
 * caller was compiled. For languages that read no headers. */
KUAFU_API ks_status kuafu_struct_init(uint32_t type, void* out, uint32_t size_bytes);
/* Text of this thread's last failed kuafu call; valid until its next kuafu call; never NULL. */
KUAFU_API const char* kuafu_last_error(void);

/* ---- device ---------------------------------------------------------------------------------------------------------------- */

/* Every Vulkan device, usable or not (info.refused says why). In: *count = capacity of infos; out: the number there is.
 * infos may be NULL to ask for the count. No Vulkan loader or driver: KS_OK with *count = 0 and the reason in kuafu_last_error(). */
KUAFU_API ks_status kuafu_device_enumerate(ks_device_info* infos, uint32_t* count);
/* KS_ERROR_NO_DEVICE names every device with its reasons and what to install. desc may be NULL (KS_SELECT_AUTO). */
KUAFU_API ks_status kuafu_device_create(const ks_device_desc* desc, kuafu_device* out);
KUAFU_API ks_status kuafu_device_get_info(kuafu_device device, ks_device_info* out);
KUAFU_API void kuafu_device_retain(kuafu_device device);
KUAFU_API void kuafu_device_release(kuafu_device device);
/* Bytes that this library copied between buffers, or between host memory and buffers, since the device was created. Zero-copy pipelines keep it still. */
KUAFU_API ks_status kuafu_device_copied_bytes(kuafu_device device, uint64_t* out);
/* Bytes of memory that this device's buffers hold now, those of renderers and scenes included. */
KUAFU_API ks_status kuafu_device_allocated_bytes(kuafu_device device, uint64_t* out);

/* ---- buffer ---------------------------------------------------------------------------------------------------------------- */

KUAFU_API ks_status kuafu_buffer_create(kuafu_device device, const ks_buffer_create* create, kuafu_buffer* out);
KUAFU_API ks_status kuafu_buffer_import(kuafu_device device, const ks_buffer_desc* desc, kuafu_buffer* out);
/* memory: KS_MEMORY_*. The descriptor's fd, if any, is the caller's to close. */
KUAFU_API ks_status kuafu_buffer_export(kuafu_buffer buffer, uint32_t memory, ks_buffer_desc* out);
/* Host address of a host-visible buffer; stays valid while the buffer lives. */
KUAFU_API ks_status kuafu_buffer_map(kuafu_buffer buffer, void** out);
KUAFU_API ks_status kuafu_buffer_write(kuafu_buffer buffer, uint64_t offset_bytes, const void* data, uint64_t size_bytes);
KUAFU_API ks_status kuafu_buffer_read(kuafu_buffer buffer, uint64_t offset_bytes, void* data, uint64_t size_bytes);
KUAFU_API void kuafu_buffer_retain(kuafu_buffer buffer);
KUAFU_API void kuafu_buffer_release(kuafu_buffer buffer);

/* ---- scene ----------------------------------------------------------------------------------------------------------------- */

KUAFU_API ks_status kuafu_scene_create(kuafu_device device, kuafu_scene* out);
KUAFU_API void kuafu_scene_retain(kuafu_scene scene);
KUAFU_API void kuafu_scene_release(kuafu_scene scene);

/* Appends a file: .gltf .glb (meshes, materials, textures, KHR_lights_punctual, cameras) or .obj .dae .stl .ply (meshes, materials).
 * root_to_world: row-major 4x4 put before every node, NULL = identity. Errors name the file and the field; the scene is then unchanged.
 * What the file has and the renderer ignores (alpha modes, animations, skins, ...) goes to the device's log as a warning. A point light's
 * candela are taken as W/sr one to one. An .mtl gives Kd (and map_Kd), Ks, Ke, Ns, Ni, d, illum, Pr and Pm; a glTF material also what its extras say
 * (kuafu_material_desc). */
KUAFU_API ks_status kuafu_scene_load(kuafu_scene scene, const char* path, const double* root_to_world);

KUAFU_API ks_status kuafu_scene_get_summary(kuafu_scene scene, kuafu_scene_summary* out);

KUAFU_API ks_status kuafu_scene_add_mesh(kuafu_scene scene, const kuafu_mesh_desc* desc, uint32_t* id);
/* Moves the mesh's vertices, for deforming bodies; triangles, uvs and slots stay. positions: [vertex_count][3] metres, as many as the mesh has.
 * normals: [vertex_count][3] unit where the mesh was made with normals, else NULL. Cost follows this mesh's size, not the scene's. */
KUAFU_API ks_status kuafu_scene_update_mesh(kuafu_scene scene, uint32_t id, const float* positions, const float* normals, uint32_t vertex_count);

KUAFU_API ks_status kuafu_scene_add_texture(kuafu_scene scene, const kuafu_texture_desc* desc, uint32_t* id);
/* Replaces a texture, also from frame to frame: materials, lights and the environment that name it show the new one. Size, channels and format may
 * change. Cost follows this texture's size, not the scene's (an environment map is also sorted by brightness again). */
KUAFU_API ks_status kuafu_scene_set_texture(kuafu_scene scene, uint32_t id, const kuafu_texture_desc* desc);

KUAFU_API ks_status kuafu_scene_add_material(kuafu_scene scene, const kuafu_material_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_material(kuafu_scene scene, uint32_t id, const kuafu_material_desc* desc);
KUAFU_API ks_status kuafu_scene_get_material(kuafu_scene scene, uint32_t id, kuafu_material_desc* out);

KUAFU_API ks_status kuafu_scene_add_instance(kuafu_scene scene, const kuafu_instance_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_instance_pose(kuafu_scene scene, uint32_t id, const double* local_to_world);
/* linear and angular: [3], as kuafu_instance_desc says. Moves nothing by itself: it is what the instance does while a shutter is open. */
KUAFU_API ks_status kuafu_scene_set_instance_velocity(kuafu_scene scene, uint32_t id, const double* linear, const double* angular);
KUAFU_API ks_status kuafu_scene_set_instance_materials(kuafu_scene scene, uint32_t id, const uint32_t* materials, uint32_t material_count);
/* Begins a frame: motion vectors from now on are against the poses that instances have now. */
KUAFU_API ks_status kuafu_scene_next_frame(kuafu_scene scene);
/* Ids are stable and not reused; ids of removed objects are refused from then on. Removing frees the object's memory, on the device with the next
 * render; some hundred bytes remain for the id. A mesh that an instance uses, a material on an instance, a texture of a material, light or
 * environment cannot be removed: the error names the user. */
KUAFU_API ks_status kuafu_scene_remove_mesh(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_texture(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_material(kuafu_scene scene, uint32_t id);
KUAFU_API ks_status kuafu_scene_remove_instance(kuafu_scene scene, uint32_t id);

/* Names as loaded, for ids 0.. of the AOVs; the pointer lives until the scene changes. NULL for an id that is not there, with the reason in kuafu_last_error(). */
KUAFU_API const char* kuafu_scene_instance_name(kuafu_scene scene, uint32_t id);
KUAFU_API const char* kuafu_scene_material_name(kuafu_scene scene, uint32_t id);

KUAFU_API ks_status kuafu_scene_add_light(kuafu_scene scene, const kuafu_light_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_light(kuafu_scene scene, uint32_t id, const kuafu_light_desc* desc);
KUAFU_API ks_status kuafu_scene_get_light(kuafu_scene scene, uint32_t id, kuafu_light_desc* out);
KUAFU_API ks_status kuafu_scene_remove_light(kuafu_scene scene, uint32_t id);

KUAFU_API ks_status kuafu_scene_set_environment(kuafu_scene scene, const kuafu_environment_desc* desc);

/* desc NULL: none, as at the start. */
KUAFU_API ks_status kuafu_scene_set_medium(kuafu_scene scene, const kuafu_medium_desc* desc);

/* index < camera_count of the summary, in the order of the file's nodes. camera_to_world has our axes, not the file's. A camera of a file has no pixels:
 * width and height are 0 and k is for an image of height 1 whose origin is its top left corner, so 2 k[2] is the aspect ratio (1 where the file has none).
 * For H rows: fx = H k[0], cx = H k[2] - 0.5, fy = H k[4], cy = H k[5] - 0.5 (pixel centres at integers), and W = 2 H k[2]. */
KUAFU_API ks_status kuafu_scene_get_camera(kuafu_scene scene, uint32_t index, kuafu_camera_desc* out);

/* ---- rendering ------------------------------------------------------------------------------------------------------------- */

KUAFU_API ks_status kuafu_renderer_create(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out);
KUAFU_API void kuafu_renderer_retain(kuafu_renderer renderer);
KUAFU_API void kuafu_renderer_release(kuafu_renderer renderer);

/* Blocks until the outputs may be read (KS_SYNC_HOST). Same inputs and seed give the same bits on one device for any thread count or batch split. */
KUAFU_API ks_status kuafu_renderer_render(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc);
/* The same, but returns at once; renders of one renderer run in the order of their submissions, on a thread of the library's, where desc->progress is
 * called. `desc` may go when the call returns. Until the render has ended, the outputs are not to be read, and the scene cannot be changed
 * (KS_ERROR_INVALID_STATE). `out` is initialised by the caller and becomes what wait takes; two submissions may be under way, a third waits for the first. */
KUAFU_API ks_status kuafu_renderer_submit(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc, ks_sync* out);
/* Blocks until that submission's outputs may be read, and returns what the render came to; KS_ERROR_TIMEOUT where it has not ended after timeout_ns: it
 * goes on, and may be waited for again. 0 only asks, UINT64_MAX waits as long as it takes. An outcome is kept until the second submission after it. */
KUAFU_API ks_status kuafu_renderer_wait(kuafu_renderer renderer, const ks_sync* sync, uint64_t timeout_ns);
/* Ends what the renderer has under way, submitted or in a call of another thread: it gives KS_ERROR_CANCELLED soon (within 0.2 s on an idle machine). Any
 * thread may call it at any time. A renderer that is released does so too, and waits for the end. */
KUAFU_API ks_status kuafu_renderer_cancel(kuafu_renderer renderer);

/* Of the last render that succeeded. */
KUAFU_API ks_status kuafu_renderer_get_summary(kuafu_renderer renderer, kuafu_render_summary* out);
/* Stage times of the last render. In: *count = capacity of times; out: the number there is. times may be NULL. */
KUAFU_API ks_status kuafu_renderer_get_stage_times(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count);

#ifdef __cplusplus
}
#endif

#endif
