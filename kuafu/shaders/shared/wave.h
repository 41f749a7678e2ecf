// SPDX-License-Identifier: Apache-2.0
// What the stages of one wave of paths share, read by GLSL and C++ (scalar layout): per-path state, queue counters, views, outputs, push
// constants.
#ifndef KUAFU_WAVE_H
#define KUAFU_WAVE_H

#include "shared/aov_record.h"
#include "shared/beam_record.h"
#include "shared/camera_record.h"
#include "shared/scene_records.h"

#ifdef __cplusplus
namespace kuafu {
#endif

// What a path sums apart, plane after plane: the projectors' light, and all other. The latter has a plane for each light group where one of
// them is asked for, or two where its direct light is: this, and the rest.
KUAFU_CONST group_projector_direct = 0u;
KUAFU_CONST group_projector_indirect = 1u;
KUAFU_CONST group_ambient = 2u;
KUAFU_CONST group_count = 3u;  // without light groups; at most
KUAFU_CONST most_groups = 6u;

// Path state: plane p of path slot s is word p * capacity + s.
KUAFU_CONST state_pixel_key = 0u;   // hash of seed, view and pixel
KUAFU_CONST state_sample = 1u;      // index in the pixel's sample sequence
KUAFU_CONST state_flags = 2u;       // environment, and path_* bits
KUAFU_CONST state_pdf = 3u;         // of the direction that the path came by, per solid angle; 0: by a mirror, or it is the camera's
KUAFU_CONST state_body = 4u;        // 1 + material of the glass that the path entered; 0: none, or it began in one
KUAFU_CONST state_throughput = 5u;  // `channels` planes; then groups * channels of radiance; then one per shadow ray of a vertex
// The word state_flags. `generate` writes it, `shade` owns it from then on:
// bits 0..19 the environment, 20..27 the length of its walk, 28 is free, 29..31 where it is and what lies behind it.
KUAFU_CONST path_environment_mask = 0x000fffffu;
KUAFU_CONST path_walk_shift = 20u;  // how often the path's ray went on inside of bodies (subsurface), which are no bounces
KUAFU_CONST path_walk_mask = 0xffu;
KUAFU_CONST walk_limit = 128u;               // then it flies straight out
KUAFU_CONST path_inside = 0x20000000u;       // the ray runs inside a body
KUAFU_CONST path_after_first = 0x40000000u;  // the path's last rough surface is the first that the camera sees
KUAFU_CONST path_all_delta = 0x80000000u;    // only mirrors and smooth glass between this ray and the camera
KUAFU_FN state_radiance(uint channels) { return state_throughput + channels; }
KUAFU_FN state_shadow(uint channels, uint groups) { return state_throughput + channels * (1u + groups); }

// A path's shadow-ray plane holds its index in the shadow queue and, above, the light group it feeds.
KUAFU_CONST shadow_none = 0xffffffffu;
KUAFU_CONST shadow_group_shift = 29u;
// A shadow ray's ray_id is the index of its contribution and, above, whether glass stops it all the same, and whether glass of bodies does.
KUAFU_CONST shadow_opaque = 0x80000000u;
KUAFU_CONST shadow_bent = 0x40000000u;
KUAFU_CONST shadow_index_mask = 0x1fffffffu;

// Counters: one block per bounce; then, where shadow rays pass glass, one per bounce and surface that they passed.
KUAFU_CONST counter_trace_arguments = 0u;  // VkDispatchIndirectCommand of `closest`
KUAFU_CONST counter_ray_count = 3u;
KUAFU_CONST counter_shade_arguments = 4u;
KUAFU_CONST counter_shadow_arguments = 8u;  // VkDispatchIndirectCommand of `occluded`
KUAFU_CONST counter_shadow_count = 11u;
KUAFU_CONST counter_transmit_arguments = 12u;  // VkDispatchIndirectCommand of `transmit`
KUAFU_CONST counter_words = 16u;

KUAFU_CONST pixel_block = 32u;  // pixels that stay together: consecutive ones, or a tile of 8 x 4

/// A pinhole camera: the ray through pixel (u, v) has direction axis_0 + u axis_u + v axis_v, whose z in the camera is 1.
struct ViewRecord {
  vec3 origin;
  vec3 axis_0, axis_u, axis_v;
  float near_m, far_m;
  uint key;  // hash of the seed and of what the camera is
  uint environment;
};
KUAFU_ARRAY(ViewArray, ViewRecord, 4)

KUAFU_CONST output_depth = 0u;
KUAFU_CONST output_normal = 1u;
KUAFU_CONST output_instance_id = 2u;
KUAFU_CONST output_material_id = 3u;
KUAFU_CONST output_semantic_id = 4u;
KUAFU_CONST output_position = 5u;
KUAFU_CONST output_albedo = 6u;
KUAFU_CONST output_roughness = 7u;
KUAFU_CONST output_transmission = 8u;
KUAFU_CONST output_projector_uv = 9u;
KUAFU_CONST output_projector_visibility = 10u;
KUAFU_CONST output_projector_geometry = 11u;
KUAFU_CONST output_motion = 12u;
KUAFU_CONST output_radiance = 13u;     // then projector direct, projector indirect, ambient
KUAFU_CONST output_light_group = 17u;  // 0, then the others
KUAFU_CONST output_ambient_direct = 21u;
KUAFU_CONST output_variance = 22u;
KUAFU_CONST output_sample_count = 23u;
KUAFU_CONST output_projector = 24u;  // made by `write`, of the two images that are its parts
KUAFU_CONST output_srgb = 25u;       // made by `srgb`, of the radiance
KUAFU_CONST output_kind_count = 26u;

// Element formats of output images; numbers are KS_FORMAT_*.
KUAFU_CONST format_u8 = 1u;
KUAFU_CONST format_u16 = 2u;
KUAFU_CONST format_u32 = 4u;
KUAFU_CONST format_f16 = 5u;
KUAFU_CONST format_f32 = 6u;
KUAFU_FN format_bits(uint format) { return format == format_u8 ? 8u : format == format_u16 || format == format_f16 ? 16u : 32u; }

/// One output image; first element and strides in elements from `words`. Strides may be negative. enabled = 0 when it is not asked for.
/// Stages write words of 32 bits alone (float32, ids as uint32); only `write` reads format and scale.
struct OutputRecord {
  UintArray words;
  int first, view_stride, row_stride;
  uint enabled;
  uint format;
  float scale;
};
KUAFU_ARRAY(OutputArray, OutputRecord, 8)

/// Which pixels and samples a wave holds: path slot = local pixel * sample_count + local sample.
struct WaveRange {
  uint first_pixel, pixel_count;  // of the permuted sequence of all views' pixels
  uint block_count,
      block_stride;  // permutation of full blocks of pixel_block pixels; stride 0: blocks are tiles where the image has no others
  uint first_sample, sample_count;
  uint width, height;
  uint capacity;
};

// Features: what a scene needs of the kernels. They are constants of a compilation, so that what no scene needs costs nothing; no bit:
// plain.
KUAFU_CONST feature_lights = 1u << 0u;      // lights with an extent or a profile (LightShape); multiple importance sampling
KUAFU_CONST feature_materials = 1u << 1u;   // rough transmission, absorption inside, rough diffuse
KUAFU_CONST feature_medium = 1u << 2u;      // a participating medium
KUAFU_CONST feature_subsurface = 1u << 3u;  // light that wanders below surfaces
KUAFU_CONST feature_motion = 1u << 4u;      // rays have a time: SceneAddresses.moves
KUAFU_CONST feature_camera = 1u << 5u;      // of `generate` and `aov`: generate_camera or aov_camera may be there
KUAFU_CONST feature_lookups =
    1u << 6u;  // textures with a lookup of their own (TextureRecord), second texture coordinates, vertex colours, normal_scale
KUAFU_CONST feature_clearcoat = 1u << 8u;             // a clear coat over the surface
KUAFU_CONST feature_diffuse_transmission = 1u << 9u;  // light that the diffuse base lets through
KUAFU_CONST feature_anisotropy = 1u << 10u;           // lobes that are drawn out along a direction
KUAFU_CONST feature_sheen = 1u << 11u;                // a lobe of fibres over the surface
KUAFU_CONST feature_iridescence = 1u << 12u;          // thin optics
KUAFU_CONST feature_dispersion = 1u << 13u;           // glass that parts colours
KUAFU_CONST feature_cutouts = 1u << 7u;               // of tracers: surfaces that are not everywhere there (alpha_mask, alpha_blend)

struct GeneratePush {
  ViewArray views;
  CameraArray cameras;  // as views; read only with generate_camera
  UintArray rays, ray_environments, state, counters;
  UintArray pixels;  // with generate_listed: how many there are, then their indices in the images; the range is of this list
  WaveRange range;
  uint channels, groups;
  uint flags;     // generate_*
  float blur_px;  // side of the square that blurs a pixel's own, 0..1
};

// Of the launch.
KUAFU_CONST generate_environments = 1u << 0u;  // rays carry an environment
KUAFU_CONST generate_camera = 1u << 1u;        // some camera distorts, has a lens, or something moves while its shutter is open
KUAFU_CONST generate_motion = 1u << 2u;        // rays have a time
KUAFU_CONST generate_replicates = 1u << 3u;    // see replicate_count
// Of the wave.
KUAFU_CONST generate_pixel_centre = 1u << 4u;  // AOV rays: no jitter, no path state
KUAFU_CONST generate_rays_only = 1u << 5u;     // no path state
KUAFU_CONST generate_listed = 1u << 6u;        // rays of some pixels

struct ShadePush {
  UintArray rays_in, rays_out, shadow_rays;
  UintArray ray_environments, shadow_environments;
  FloatArray contributions;  // plane c of shadow ray i is c * shadow_capacity + i; with glass, plane `channels` is the way left in metres
  UintArray state, counters;
  SceneReference scene;
  uint capacity, shadow_capacity;
  uint bounce, max_bounces;
  uint shadow_rays_per_vertex, flags;  // shade_*
  uint groups, reserved;
  SplatTableArray splats;  // null without shade_bends
};

// Of the scene.
KUAFU_CONST shade_environments = 1u << 0u;   // rays carry an environment
KUAFU_CONST shade_ambient = 1u << 1u;        // there is light that only BSDF rays find: environment or emission
KUAFU_CONST shade_select_lights = 1u << 2u;  // too many lights: take one by power
KUAFU_CONST shade_medium = 1u << 3u;         // there is a medium; half of a vertex' shadow rays are those of its scattering
// Of the launch.
KUAFU_CONST shade_lights_only = 1u << 4u;    // light with an extent is found by light samples alone, or
KUAFU_CONST shade_bsdf_only = 1u << 5u;      // by BSDF samples alone; else by both, weighted
KUAFU_CONST shade_glass_shadows = 1u << 6u;  // shadow rays pass smooth glass: they stand in a closest queue, and `transmit` follows them
KUAFU_CONST shade_bends = 1u << 7u;          // bodies of it bend light: `gather` finds where that landed, and no shadow ray passes them
KUAFU_CONST shade_direct_apart = 1u << 8u;   // light of group_ambient met one surface, that of the next group more

struct ResolvePush {
  UintArray rays, shadow_rays;
  FloatArray contributions;
  UintArray state, counters;
  uint capacity, shadow_capacity, bounce, shadow_rays_per_vertex, channels, groups;
  uint glass_shadows;  // nonzero: what is blocked contributes 0 already
  uint reserved;
};

/// One surface on the way of the shadow rays.
struct TransmitPush {
  UintArray rays_in, rays_out;  // closest queues
  UintArray environments_in, environments_out;
  FloatArray contributions;
  UintArray counters;
  SceneReference scene;
  uint capacity;
  uint block_in, block_out;  // of counters
  uint has_environments;
  uint last;  // nonzero: whatever stands in the way blocks
  uint has_medium;
};

/// Where the variance of a pixel's mean is asked for, its samples are dealt out to this many sequences with scrambles of their own: sample
/// i is number i / replicate_count of sequence i % replicate_count. Their means are independent, as points of one scrambled sequence are
/// not.
KUAFU_CONST replicate_count = 8u;

struct AccumulatePush {
  FloatArray state,
      sums;  // sums: plane p of local pixel i is p * sums_stride + sums_first + i; planes: (group, channel), then (channel, replicate)
  OutputArray outputs;
  WaveRange range;
  uint channels, groups, flags;  // accumulate_*
  uint sums_first, sums_stride;
  uint first_sample, sample_count;  // of all passes until now
  float inverse_samples;
  uint reserved;
};

KUAFU_CONST accumulate_continues = 1u << 0u;   // there are sums of earlier passes
KUAFU_CONST accumulate_keeps = 1u << 1u;       // later passes will want the sums
KUAFU_CONST accumulate_writes = 1u << 2u;      // the outputs
KUAFU_CONST accumulate_replicates = 1u << 3u;  // see replicate_count

struct AovPush {
  UintArray rays;
  SceneReference scene;
  ViewArray views;
  CameraArray cameras;
  OutputArray outputs;
  AovReference aov;
  UintArray shadow_rays, shadow_environments, counters;
  WaveRange range;
  uint shadow_capacity, flags;  // aov_*
};

KUAFU_CONST aov_infrared = 1u << 0u;
KUAFU_CONST aov_projector = 1u << 1u;     // AovAddresses has projectors
KUAFU_CONST aov_visibility = 1u << 2u;    // and shadow rays to them are asked for
KUAFU_CONST aov_motion = 1u << 3u;        // AovAddresses has motion
KUAFU_CONST aov_environments = 1u << 4u;  // shadow rays carry an environment
KUAFU_CONST aov_camera = 1u << 5u;        // as generate_camera

/// A held image (frame/frame.h), packed [view][row][column][channel], on its way to the caller's.
struct WritePush {
  UintArray from;
  OutputRecord to;
  uint count, width, height;  // pixels of all views
  uint channels;
  uint integer;  // nonzero: ids or counts, not floats
  uint sums;     // nonzero: `second` is added to `from`
  FloatArray second;
};

#ifdef __cplusplus
static_assert(walk_limit <= path_walk_mask && (path_environment_mask & path_walk_mask << path_walk_shift) == 0);
static_assert(((path_environment_mask | path_walk_mask << path_walk_shift) & (path_inside | path_after_first | path_all_delta)) == 0);
static_assert(sizeof(ViewRecord) == 64);
static_assert(sizeof(OutputRecord) == 32);
static_assert(sizeof(GeneratePush) == 112);
static_assert(sizeof(ShadePush) == 112);
static_assert(sizeof(ResolvePush) == 72);
static_assert(sizeof(TransmitPush) == 80);
static_assert(sizeof(AccumulatePush) == 96);
static_assert(sizeof(AovPush) == 120);
static_assert(sizeof(WritePush) == 72);
}  // namespace kuafu
#endif
#endif
