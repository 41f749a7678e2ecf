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
#include "kuafu/film.h"
#include "kuafu/material.h"
#include "kuafu/medium.h"
#include "kuafu/output.h"

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

#define KUAFU_ALL_ENVIRONMENTS 0xffffffffu /* an instance or light that every environment of the batch sees */

#define KUAFU_TYPE_MESH_DESC 0x1001u
#define KUAFU_TYPE_TEXTURE_DESC 0x1002u
#define KUAFU_TYPE_INSTANCE_DESC 0x1004u
#define KUAFU_TYPE_LIGHT_DESC 0x1005u
#define KUAFU_TYPE_ENVIRONMENT_DESC 0x1007u
#define KUAFU_TYPE_VIEW_DESC 0x1008u
#define KUAFU_TYPE_RENDER_DESC 0x100au
#define KUAFU_TYPE_SCENE_SUMMARY 0x100bu
#define KUAFU_TYPE_RENDER_SUMMARY 0x100eu
#define KUAFU_TYPE_RENDERER_DESC 0x100cu

KUAFU_API ks_status kuafu_scene_create(kuafu_device device, kuafu_scene* out);
KUAFU_API void kuafu_scene_retain(kuafu_scene scene);
KUAFU_API void kuafu_scene_release(kuafu_scene scene);

/* Appends a file: .gltf .glb (meshes, materials, textures, KHR_lights_punctual, cameras) or .obj .dae .stl .ply (meshes, materials).
 * root_to_world: row-major 4x4 put before every node, NULL = identity. Errors name the file and the field; the scene is then unchanged.
 * What the file has and the renderer ignores (alpha modes, animations, skins, ...) goes to the device's log as a warning. A point light's
 * candela are taken as W/sr one to one. An .mtl gives Kd (and map_Kd), Ks, Ke, Ns, Ni, d, illum, Pr and Pm; a glTF material also what its extras say
 * (kuafu_material_desc). */
KUAFU_API ks_status kuafu_scene_load(kuafu_scene scene, const char* path, const double* root_to_world);

typedef struct kuafu_scene_summary {
  ks_header header;
  uint32_t mesh_count, texture_count, material_count, instance_count, light_count, camera_count; /* removed ones not counted */
  uint64_t triangle_count;     /* of all instances */
  double bounds_min_m[3];      /* world, of all instances; +inf/-inf when empty */
  double bounds_max_m[3];
} kuafu_scene_summary;
static inline kuafu_scene_summary kuafu_scene_summary_init(void) {
  kuafu_scene_summary s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_SCENE_SUMMARY, (uint32_t)sizeof s);
  return s;
}
KUAFU_API ks_status kuafu_scene_get_summary(kuafu_scene scene, kuafu_scene_summary* out);

/* Triangles. Counts are of vertices and triangles. normals, uvs and slots may be NULL. Data is copied. */
typedef struct kuafu_mesh_desc {
  ks_header header;
  const char* name;
  const float* positions;    /* [vertex_count][3] metres */
  const float* normals;      /* [vertex_count][3] unit, or NULL: geometric normals */
  const float* uvs;          /* [vertex_count][2], v down as in glTF, or NULL */
  const uint32_t* indices;   /* [triangle_count][3] */
  const uint32_t* slots;     /* [triangle_count] index into the instance's materials, or NULL: 0 */
  uint32_t vertex_count;
  uint32_t triangle_count;
} kuafu_mesh_desc;
static inline kuafu_mesh_desc kuafu_mesh_desc_init(void) {
  kuafu_mesh_desc m;
  memset(&m, 0, sizeof m);
  m.header = ks_header_make(KUAFU_TYPE_MESH_DESC, (uint32_t)sizeof m);
  return m;
}
KUAFU_API ks_status kuafu_scene_add_mesh(kuafu_scene scene, const kuafu_mesh_desc* desc, uint32_t* id);
/* Moves the mesh's vertices, for deforming bodies; triangles, uvs and slots stay. positions: [vertex_count][3] metres, as many as the mesh has.
 * normals: [vertex_count][3] unit where the mesh was made with normals, else NULL. Cost follows this mesh's size, not the scene's. */
KUAFU_API ks_status kuafu_scene_update_mesh(kuafu_scene scene, uint32_t id, const float* positions, const float* normals, uint32_t vertex_count);

/* Row 0 first, u right, v down. Data is copied. */
typedef struct kuafu_texture_desc {
  ks_header header;
  const char* name;
  const void* texels;   /* [height][width][channels] */
  uint32_t width, height;
  uint32_t channels;    /* 1..4 */
  uint32_t format;      /* KS_FORMAT_U8 (0..1), KS_FORMAT_U16 (0..1), KS_FORMAT_F32 */
  uint32_t srgb;        /* nonzero: colour channels are sRGB-encoded; 0: linear data */
  uint32_t reserved;
} kuafu_texture_desc;
static inline kuafu_texture_desc kuafu_texture_desc_init(void) {
  kuafu_texture_desc t;
  memset(&t, 0, sizeof t);
  t.header = ks_header_make(KUAFU_TYPE_TEXTURE_DESC, (uint32_t)sizeof t);
  return t;
}
KUAFU_API ks_status kuafu_scene_add_texture(kuafu_scene scene, const kuafu_texture_desc* desc, uint32_t* id);
/* Replaces a texture, also from frame to frame: materials, lights and the environment that name it show the new one. Size, channels and format may
 * change. Cost follows this texture's size, not the scene's (an environment map is also sorted by brightness again). */
KUAFU_API ks_status kuafu_scene_set_texture(kuafu_scene scene, uint32_t id, const kuafu_texture_desc* desc);

KUAFU_API ks_status kuafu_scene_add_material(kuafu_scene scene, const kuafu_material_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_material(kuafu_scene scene, uint32_t id, const kuafu_material_desc* desc);
KUAFU_API ks_status kuafu_scene_get_material(kuafu_scene scene, uint32_t id, kuafu_material_desc* out);

typedef struct kuafu_instance_desc {
  ks_header header;
  const char* name;
  uint32_t mesh;
  uint32_t environment;        /* KUAFU_ALL_ENVIRONMENTS or 0.. */
  const uint32_t* materials;   /* [material_count], one per slot of the mesh; NULL or short: a grey Lambertian default */
  uint32_t material_count;
  uint32_t semantic_id;
  double local_to_world[16];
  double linear_velocity[3];   /* twist in the instance's own frame, m/s and rad/s. The frame has local_to_world's origin and rotation, not its scale
                                  (the rotation nearest to it, where it shears) */
  double angular_velocity[3];
} kuafu_instance_desc;
static inline kuafu_instance_desc kuafu_instance_desc_init(uint32_t mesh) {
  kuafu_instance_desc d;
  int i;
  memset(&d, 0, sizeof d);
  d.header = ks_header_make(KUAFU_TYPE_INSTANCE_DESC, (uint32_t)sizeof d);
  d.mesh = mesh;
  d.environment = KUAFU_ALL_ENVIRONMENTS;
  for (i = 0; i < 4; ++i) d.local_to_world[5 * i] = 1.0;
  return d;
}
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

#define KUAFU_LIGHT_POINT 1u
#define KUAFU_LIGHT_PROJECTOR 2u /* a point with a textured radiant intensity: texture value in [0,1] times intensity, towards pixel (u,v) of K, bilinear, 0 outside */
#define KUAFU_LIGHT_DIRECTIONAL 3u /* from infinitely far, along +z; a disc of half angle angle_rad in the sky */
#define KUAFU_LIGHT_SPOT 4u        /* a point; full within inner_rad of +z, falling to 0 at outer_rad as KHR_lights_punctual says */
#define KUAFU_LIGHT_RECTANGLE 5u   /* size_m, centred in the frame's xy plane; shines towards +z */
#define KUAFU_LIGHT_DISK 6u        /* radius_m, the same */
/* Lights with an extent are seen, by the camera and in mirrors, and block nothing; both light and BSDF samples find them. */

typedef struct kuafu_light_desc {
  ks_header header;
  const char* name;
  uint32_t kind;             /* KUAFU_LIGHT_* */
  uint32_t environment;      /* KUAFU_ALL_ENVIRONMENTS or 0.. */
  float intensity[3];        /* visible band. Point, spot, projector: radiant intensity, W/sr; directional: irradiance on a surface that faces it, W/m^2;
                                rectangle, disk: radiance, W/(sr m^2). A projector's is 0 by default: an RGB camera does not see it */
  float ir_intensity;        /* infrared band, the same unit; NAN = red of `intensity` times kuafu_render_desc.ir_ambient_scale */
  double light_to_world[16]; /* +z is the projector's optical axis, x right, y down */
  uint32_t texture;          /* projector: pattern, red channel read linearly (KUAFU_NONE with dots). Else a factor, or KUAFU_NONE: over a rectangle or a disk's square; over the
                                square around a spot's outer cone; equirectangular around a point; directional: tiles of size_m across it */
  uint32_t light_group;      /* KUAFU_OUTPUT_LIGHT_GROUP_0 + light_group gets its light, 0..3; a projector's goes to its own two outputs */
  double k[9];               /* projector: row-major 3x3 in pixels of the texture */
  double radius_m;           /* point: of the sphere that shines, 0 = a point; disk; projector: of its lens, which blurs by radius |1/z - 1/focus_m| f */
  double angle_rad;          /* directional: half angle of its disc, 0 = parallel light; at most pi/2 */
  double inner_rad, outer_rad; /* spot: half angles, 0 <= inner < outer <= pi/2 */
  double size_m[2];          /* rectangle: width and height; directional with a texture: of a tile */
  double distortion[8];      /* projector: k1 k2 p1 p2 k3 k4 k5 k6 of Brown and Conrady (OpenCV's order) */
  double falloff;            /* projector: intensity times cos^falloff of the angle from its axis */
  double focus_m;            /* projector: distance of its sharpest image; 0 = sharp everywhere */
  double pattern_scale;      /* projector: magnifies the pattern about K's principal point, > 0; 1 = neutral */
  const float* dots;         /* projector: [dot_count][3] u, v in pixels and power, or NULL: its pattern is `texture`. Else a Gaussian each, integrated over the
                                pixels of pattern_width x pattern_height, which K's pixels then are; power is the pattern's integral over the dot in pixels
                                squared, so a lone dot peaks at about power / (2 pi dot_sigma_px^2). Copied; as read back: valid until the scene changes */
  uint32_t dot_count;
  uint32_t pattern_width, pattern_height;
  float dot_sigma_px;        /* > 0 */
  double linear_velocity[3];   /* twist in the light's own frame, m/s and rad/s */
  double angular_velocity[3];
  double on_from_s, on_until_s; /* it shines within this window of the frame's time; equal = always */
} kuafu_light_desc;
static inline kuafu_light_desc kuafu_light_desc_init(uint32_t kind) {
  kuafu_light_desc l;
  int i;
  memset(&l, 0, sizeof l);
  l.header = ks_header_make(KUAFU_TYPE_LIGHT_DESC, (uint32_t)sizeof l);
  l.kind = kind;
  l.environment = KUAFU_ALL_ENVIRONMENTS;
  l.ir_intensity = NAN;
  l.texture = KUAFU_NONE;
  for (i = 0; i < 4; ++i) l.light_to_world[5 * i] = 1.0;
  for (i = 0; i < 3; ++i) l.k[4 * i] = 1.0;
  l.outer_rad = 0.78539816339744831;
  l.pattern_scale = 1.0;
  return l;
}
KUAFU_API ks_status kuafu_scene_add_light(kuafu_scene scene, const kuafu_light_desc* desc, uint32_t* id);
KUAFU_API ks_status kuafu_scene_set_light(kuafu_scene scene, uint32_t id, const kuafu_light_desc* desc);
KUAFU_API ks_status kuafu_scene_get_light(kuafu_scene scene, uint32_t id, kuafu_light_desc* out);
KUAFU_API ks_status kuafu_scene_remove_light(kuafu_scene scene, uint32_t id);

/* Radiance from all directions, seen by every ray that leaves the scene: uniform, or times an equirectangular map, which is sampled by its brightness. */
typedef struct kuafu_environment_desc {
  ks_header header;
  float radiance[3];     /* visible band, W/(sr m^2) */
  float ir_radiance;     /* infrared band; NAN = red of `radiance` times ir_ambient_scale plus ir_ambient_radiance (kuafu_render_desc) */
  uint32_t texture;      /* factor (infrared: its red), or KUAFU_NONE. Its middle column lies towards +z of the map's frame, columns go towards +x, row 0 is -y (up) */
  uint32_t light_group;  /* 0..3 */
  double map_to_world[9]; /* row-major rotation */
} kuafu_environment_desc;
static inline kuafu_environment_desc kuafu_environment_desc_init(void) {
  kuafu_environment_desc e;
  int i;
  memset(&e, 0, sizeof e);
  e.header = ks_header_make(KUAFU_TYPE_ENVIRONMENT_DESC, (uint32_t)sizeof e);
  e.ir_radiance = NAN;
  e.texture = KUAFU_NONE;
  for (i = 0; i < 3; ++i) e.map_to_world[4 * i] = 1.0;
  return e;
}
KUAFU_API ks_status kuafu_scene_set_environment(kuafu_scene scene, const kuafu_environment_desc* desc);

/* desc NULL: none, as at the start. */
KUAFU_API ks_status kuafu_scene_set_medium(kuafu_scene scene, const kuafu_medium_desc* desc);

/* index < camera_count of the summary, in the order of the file's nodes. camera_to_world has our axes, not the file's. A camera of a file has no pixels:
 * width and height are 0 and k is for an image of height 1 whose origin is its top left corner, so 2 k[2] is the aspect ratio (1 where the file has none).
 * For H rows: fx = H k[0], cx = H k[2] - 0.5, fy = H k[4], cy = H k[5] - 0.5 (pixel centres at integers), and W = 2 H k[2]. */
KUAFU_API ks_status kuafu_scene_get_camera(kuafu_scene scene, uint32_t index, kuafu_camera_desc* out);

/* ---- rendering ------------------------------------------------------------------------------------------------------------- */

/* AUTO: Embree on CPU devices, the own BVH in compute on GPUs. RT_PIPELINE, the driver's ray tracing pipelines, needs KS_CAP_RAY_TRACING_PIPELINE and
 * is worth choosing on GPUs with hardware for rays, which no Vulkan query tells; on an H200, which has none, the own BVH is 1.8 times as fast. */
#define KUAFU_TRACER_AUTO 0u
#define KUAFU_TRACER_EMBREE 1u
#define KUAFU_TRACER_COMPUTE 2u
#define KUAFU_TRACER_RT_PIPELINE 3u /* VK_KHR_ray_tracing_pipeline */

typedef struct kuafu_renderer_desc {
  ks_header header;
  uint32_t tracer;   /* KUAFU_TRACER_* */
  uint32_t reserved;
  const char* oidn_library; /* path of Open Image Denoise's library, for KUAFU_DENOISE_OIDN; NULL: environment variable KUAFU_OIDN_LIBRARY, else its usual names */
} kuafu_renderer_desc;
KUAFU_API ks_status kuafu_renderer_create(kuafu_device device, const kuafu_renderer_desc* desc, kuafu_renderer* out);
KUAFU_API void kuafu_renderer_retain(kuafu_renderer renderer);
KUAFU_API void kuafu_renderer_release(kuafu_renderer renderer);

/* How light with an extent (rectangles, disks, spheres, emissive surfaces, the environment's map) is found. All three give the same mean. */
#define KUAFU_SAMPLING_MIS 0u    /* by samples of the lights and of the BSDF, weighted (Veach's power heuristic) */
#define KUAFU_SAMPLING_LIGHTS 1u /* by samples of the lights alone, except in mirrors */
#define KUAFU_SAMPLING_BSDF 2u   /* by samples of the BSDF alone */

#define KUAFU_BAND_VISIBLE 0u  /* RGB: the projector gives its visible intensity, 0 by default */
#define KUAFU_BAND_INFRARED 1u /* one channel: ir_albedo, ir intensities, ambient lights scaled */

typedef struct kuafu_view_desc {
  ks_header header;
  kuafu_camera_desc camera;
  uint32_t band;         /* KUAFU_BAND_* */
  uint32_t environment;  /* which environment of the batch this view looks into; 0 for a single one */
  const kuafu_film_desc* film; /* NULL: perfect optics */
  double previous_camera_to_world[16]; /* one frame before, for motion vectors; all 0: as now */
} kuafu_view_desc;
static inline kuafu_view_desc kuafu_view_desc_init(void) {
  kuafu_view_desc v;
  memset(&v, 0, sizeof v);
  v.header = ks_header_make(KUAFU_TYPE_VIEW_DESC, (uint32_t)sizeof v);
  v.camera = kuafu_camera_desc_init();
  return v;
}

/* What takes the noise out of the image. The projectors' direct light carries the dots and is never touched; all other images of light are. Same inputs, same bits. */
#define KUAFU_DENOISE_NONE 0u
#define KUAFU_DENOISE_ATROUS 1u /* filter guided by surfaces and by the samples' own scatter; then 16 rays per pixel put textures and edges back where there are some */
#define KUAFU_DENOISE_OIDN 2u   /* Open Image Denoise, versions 1 and 2, opened at run time, on the host; KS_ERROR_UNSUPPORTED where it is not found */

typedef struct kuafu_render_desc {
  ks_header header;
  const kuafu_view_desc* views;      /* [view_count]; all of one width, height and band */
  const kuafu_output_desc* outputs;  /* [output_count] */
  uint32_t view_count;
  uint32_t output_count;
  uint32_t samples_per_pixel;        /* >= 1 */
  uint32_t max_bounces;              /* surface interactions (and scatterings of a medium) after the first; 0 = direct light only */
  uint64_t seed;
  uint32_t first_sample;             /* continue a sequence: samples first_sample .. first_sample + samples_per_pixel - 1 */
  float ir_ambient_scale;            /* what visible lights give in the infrared where they do not say (the paper's a = 0.05) */
  float ir_ambient_radiance;         /* weak constant added to the environment in the infrared where it does not say, W/(sr m^2) */
  uint32_t glass_surfaces;           /* smooth glass surfaces that light of points, directions and projectors passes straight on its way to a surface, dimmed by
                                        Fresnel's reflection, tint and absorption; 0 = glass casts full shadows */
  ks_progress_fn progress;           /* may be NULL */
  void* progress_user;
  uint32_t light_sampling;           /* KUAFU_SAMPLING_* */
  uint32_t denoise;                  /* KUAFU_DENOISE_* */
  uint32_t projector;                /* light id, for KUAFU_OUTPUT_PROJECTOR_UV, _VISIBILITY, _GEOMETRY; KUAFU_NONE: the first that a view's environment has */
  float temporal_weight;             /* KUAFU_DENOISE_ATROUS: share of the light that this renderer's last renders of as many views of one size saw on the same
                                        surface, 0..<1; 0: each render by itself. It follows cameras (of any lens and shutter) and instances that move, and starts
                                        anew where another surface or instance appears. Where light changes by more than this render's noise, what was is
                                        forgotten; smaller changes, reflections and deforming meshes lag. Give every render another seed */
  uint32_t accumulate;               /* nonzero: these samples are added to those that the renderer has accumulated since its last call without it, and the images
                                        are means of all. They go on where the last call ended. A call of other sizes, band, light groups or variance, and one
                                        that fails, begins anew. Cameras and scene may move in between: the images are then means over that time */
  uint32_t reserved;
  /* Budgets, 0 = none: samples_per_pixel is then the most. The render goes in rounds over all views, at least one, and stops before max_seconds are over (as
   * the rounds before tell), or when the noise falls to relative_error: the root of the pixels' mean KUAFU_OUTPUT_VARIANCE over their mean radiance, over all
   * views and channels. What counts is its upper limit, 84 % sure by the scatter of the pixels' variances: few pixels, or rare bright samples, tell little,
   * and take more. A noise budget alone is deterministic. */
  double max_seconds;
  double relative_error;
} kuafu_render_desc;
static inline kuafu_render_desc kuafu_render_desc_init(void) {
  kuafu_render_desc r;
  memset(&r, 0, sizeof r);
  r.header = ks_header_make(KUAFU_TYPE_RENDER_DESC, (uint32_t)sizeof r);
  r.samples_per_pixel = 16;
  r.max_bounces = 8;
  r.ir_ambient_scale = 0.05f;
  r.ir_ambient_radiance = 0.002f;
  r.glass_surfaces = 8;
  r.projector = KUAFU_NONE;
  return r;
}
/* Blocks until the outputs may be read (KS_SYNC_HOST). Same inputs and seed give the same bits on one device for any thread count or batch split. */
KUAFU_API ks_status kuafu_renderer_render(kuafu_renderer renderer, kuafu_scene scene, const kuafu_render_desc* desc);

typedef struct kuafu_render_summary {
  ks_header header;
  uint32_t samples_per_pixel;       /* in the images */
  uint32_t call_samples_per_pixel;  /* of those, this call's */
  double relative_error;            /* as kuafu_render_desc.relative_error; NAN where none was aimed at */
  double seconds;                   /* wall time of the call */
} kuafu_render_summary;
static inline kuafu_render_summary kuafu_render_summary_init(void) {
  kuafu_render_summary s;
  memset(&s, 0, sizeof s);
  s.header = ks_header_make(KUAFU_TYPE_RENDER_SUMMARY, (uint32_t)sizeof s);
  return s;
}
/* Of the last render that succeeded. */
KUAFU_API ks_status kuafu_renderer_get_summary(kuafu_renderer renderer, kuafu_render_summary* out);
/* Stage times of the last render. In: *count = capacity of times; out: the number there is. times may be NULL. */
KUAFU_API ks_status kuafu_renderer_get_stage_times(kuafu_renderer renderer, ks_stage_time* times, uint32_t* count);

#ifdef __cplusplus
}
#endif

#endif
