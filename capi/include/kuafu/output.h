/* What a render writes, and where: part of kuafu.h, which includes it. */
#ifndef KUAFU_OUTPUT_H
#define KUAFU_OUTPUT_H

#include <string.h>

#include "ks/header.h"
#include "ks/image.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct kuafu_buffer_t* kuafu_buffer;

#define KUAFU_TYPE_OUTPUT_DESC 0x1009u

/* What an output holds; C is the channel count for an infrared / a visible view. Radiance is the mean over the pixel's square.
 * Formats: F32, F16, U16 or U8 for numbers; U32, U16 or U8 for ids. See kuafu_output_desc.scale. */
#define KUAFU_OUTPUT_RADIANCE 1u           /* 1 / 3: sum of all light groups */
#define KUAFU_OUTPUT_PROJECTOR_DIRECT 2u   /* 1 / 3: projector light with one surface between it and the camera (mirrors and smooth glass not counted) */
#define KUAFU_OUTPUT_PROJECTOR_INDIRECT 3u /* 1 / 3: the rest of the projectors' light */
#define KUAFU_OUTPUT_AMBIENT 4u            /* 1 / 3: every other light */
#define KUAFU_OUTPUT_LIGHT_GROUP_0 5u      /* C each: lights, emission and environment of one light_group; + 1, + 2, + 3 for the others. Together they are AMBIENT */
/* C: variance of the pixel's mean, of all light groups, before denoising and film optics; infinite for one sample. Unbiased for whole multiples of 8 samples: where it is
 * asked for, samples are dealt out to 8 independent sequences, so the noise of the images is another than without it. */
#define KUAFU_OUTPUT_VARIANCE 9u
#define KUAFU_OUTPUT_SAMPLE_COUNT 10u /* 1, U32: samples in the pixel's mean */
/* AOVs are taken at the pixel's centre. Where nothing is hit, positions and places are NaN, ids KUAFU_NONE, all else 0. */
#define KUAFU_OUTPUT_DEPTH 16u             /* 1: z in metres, 0 = nothing hit */
#define KUAFU_OUTPUT_NORMAL 17u            /* 3: shading normal, world frame, 0 = nothing hit */
#define KUAFU_OUTPUT_INSTANCE_ID 18u       /* 1, id: instance id, KUAFU_NONE = nothing hit */
#define KUAFU_OUTPUT_MATERIAL_ID 19u       /* 1, id: material id, KUAFU_NONE = nothing hit */
#define KUAFU_OUTPUT_SEMANTIC_ID 20u       /* 1, id: kuafu_instance_desc.semantic_id */
#define KUAFU_OUTPUT_POSITION 21u          /* 3: world, metres */
#define KUAFU_OUTPUT_ALBEDO 22u            /* C: base colour in the band: diffuse albedo, or a metal's reflectance */
#define KUAFU_OUTPUT_ROUGHNESS 23u         /* 1: of the material there */
#define KUAFU_OUTPUT_TRANSMISSION 24u      /* 1: of the material there */
/* Of one projector (kuafu_render_desc.projector), dark in the band or not. Its light on a Lambertian surface, without lens falloff, is
 * albedo / pi * intensity * pattern(uv) * visibility * geometry. */
#define KUAFU_OUTPUT_PROJECTOR_UV 25u         /* 2: pixel of its pattern, centres at integers; NaN outside the pattern */
#define KUAFU_OUTPUT_PROJECTOR_VISIBILITY 26u /* 1: 1 where the straight way from it is free and the surface faces it inside the pattern, else 0; glass blocks */
#define KUAFU_OUTPUT_PROJECTOR_GEOMETRY 27u   /* 1: cos / distance^2 with the shading normal, 1/m^2; 0 where the surface faces away; shadows do not matter */
/* 2, pixels: where the camera sees the surface point now, less where it saw it one frame before (kuafu_scene_next_frame and
 * kuafu_view_desc.previous_camera_to_world), at the same time of the frame; NaN where that was behind the camera. Deformations of meshes are
 * not known to it. */
#define KUAFU_OUTPUT_MOTION 28u

typedef struct kuafu_output_desc {
  ks_header header;
  uint32_t output;      /* KUAFU_OUTPUT_* */
  float scale;          /* numbers are written times this. 0: 1 for F32 and F16; 255 for U8 and 65535 for U16, so that 1.0 is full range. U8 and U16 are
                           rounded and clamped, NaN is 0; F16 is clamped to +-65504. Ids are not scaled; ids of the scene that do not fit their format
                           are an error, and KUAFU_NONE is the format's largest number */
  kuafu_buffer buffer;
  ks_image_desc image;  /* [view_count][height][width][C], packed in the last two dimensions */
} kuafu_output_desc;
static inline kuafu_output_desc kuafu_output_desc_init(uint32_t output, kuafu_buffer buffer, ks_image_desc image) {
  kuafu_output_desc o;
  memset(&o, 0, sizeof o);
  o.header = ks_header_make(KUAFU_TYPE_OUTPUT_DESC, (uint32_t)sizeof o);
  o.output = output;
  o.buffer = buffer;
  o.image = image;
  return o;
}

#ifdef __cplusplus
}
#endif

#endif
