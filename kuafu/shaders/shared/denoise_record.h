// SPDX-License-Identifier: Apache-2.0
// What the denoiser knows of each pixel, and the launches of its stages; read by GLSL and C++ (scalar layout).
#ifndef KUAFU_DENOISE_RECORD_H
#define KUAFU_DENOISE_RECORD_H

#include "shared/aov_record.h"
#include "shared/camera_record.h"
#include "shared/wave.h"

#ifdef __cplusplus
namespace kuafu {
#endif

/// The surface that a ray from the camera met.
struct GuideRecord {
  vec3 normal;  // shading normal, on the viewer's side
  uint material;  // miss: nothing hit
  vec3 position;
  float footprint_m;  // of a pixel, across the ray
  vec3 albedo;  // what light is divided by before it is filtered
  float normal_exponent;  // of the cosine between normals: what is alike for a rough surface is not for a mirror
};
// In memory: three vec4 (lib/alike.glsl), each in a line of guide_block pixels, so that neighbours lie side by side.
KUAFU_ARRAY(GuideArray, vec4, 16)
KUAFU_CONST guide_block = 32u;
KUAFU_FN guide_words(uint pixels) { return (pixels + guide_block - 1u) / guide_block * guide_block * 12u; }
KUAFU_FN guide_place(uint pixel, uint k) { return (pixel / guide_block * 3u + k) * guide_block + pixel % guide_block; }
KUAFU_CONST mixed_materials = 0xfffffffeu;  // GuideRecord.material of a blurred pixel that shows several

/// How a view of the last launch saw the world.
struct HistoryView {
  MotionView camera;  // `now` is where it was then
  MotionRecord motion;
  vec2 seconds_per_pixel;  // rolling shutter: along columns and rows
};
KUAFU_ARRAY(HistoryViewArray, HistoryView, 4)

/// Where the last launch saw what a pixel shows now, and how that stood then.
struct PlaceRecord {
  vec3 position, normal;
  vec2 image_point;  // pixels; x < -1: nowhere
  uint instance;
};
KUAFU_ARRAY(PlaceArray, PlaceRecord, 4)
KUAFU_CONST place_words = 9u;

/// Writes the guides of pixel centres.
struct GuidePush {
  UintArray rays;
  SceneReference scene;
  ViewArray views;
  UintArray guides;
  WaveRange range;
  uint count;  // pixels
  uint infrared;
  // Of History: written where history is not 0; 2: there was a launch before.
  UintArray places;
  HistoryViewArray last_views;
  Vec4Array last_local_to_world;  // rows, three of each instance slot; zeros where it was not there
  uint history, reserved;
};

// What is kept of a pixel's samples: their sum, the sum of squares of their blocks' sums over the blocks' sizes, and the number of blocks.
KUAFU_CONST moment_words = 3u;

/// Adds the moments of a pixel's samples, the mean over channels of all light but the projectors' direct one.
struct MomentsPush {
  FloatArray state;
  FloatArray moments;  // [pixel][moment_words]
  WaveRange range;
  uint count;  // pixels
  uint channels, groups, first_pass;
};

KUAFU_CONST most_denoised = 5u;  // images: projector indirect, and ambient or its light groups
KUAFU_CONST most_planes = 3u * most_denoised;  // with a channel each of red, green and blue

/// The images of one launch, packed [pixel][channel]; those with address 0 are not there.
struct DenoiseImages {
  FloatArray denoised[most_denoised];
  FloatArray direct, ambient, radiance;
  uint denoised_count, channels;
  // What the last launch accumulated, and what this one does; of denoise_accumulate.
  FloatArray last_light, next_light;    // as DenoisePush's light
  FloatArray last_pixels, next_pixels;  // [pixel][history_words]
  GuideArray last_guides;
  PlaceArray places, last_places;
  float temporal_weight;
  uint has_last;
};
KUAFU_ARRAY(DenoiseImagesArray, DenoiseImages, 8)

KUAFU_CONST denoise_divide = 0u;     // by albedo; statistics of each pixel
KUAFU_CONST denoise_despeckle = 1u;  // neighbours' variance; what is far above them by its own noise
KUAFU_CONST denoise_accumulate = 2u;  // over launches
KUAFU_CONST denoise_smooth = 3u;      // levels that the next pass tells pixels apart by; light stays where it is
KUAFU_CONST denoise_atrous = 4u;      // one pass of the filter, its taps `spacing` pixels apart
KUAFU_CONST denoise_multiply = 5u;    // by albedo, where no rays do it
KUAFU_CONST denoise_sum = 6u;        // what filtering is worth to each pixel; ambient and radiance from their parts

// Whether one ray tells what a pixel shows.
KUAFU_CONST square_plain = 0u;
KUAFU_CONST square_varied = 1u;  // what is around it differs somewhat: rays over the pixel's square ask
KUAFU_CONST square_edge = 2u;    // its samples may be of several surfaces
KUAFU_CONST square_rays = 16u;   // that ask

/// What the filter knows of a pixel's light over albedo, the mean over channels of all images together.
struct PixelStatistics {
  float level;
  float variance;    // of that mean
  float confidence;  // 1; less where the pixel's samples may be of several surfaces
  uint square;       // square_*
};
KUAFU_WRITTEN_ARRAY(PixelStatisticsArray, PixelStatistics, 16)

/// What the next pass tells pixels apart by.
struct SmoothStatistics {
  float level;           // mean over like neighbours
  float variance;        // of that mean
  float pixel_variance;  // as PixelStatistics
  float confidence;
};
KUAFU_WRITTEN_ARRAY(SmoothStatisticsArray, SmoothStatistics, 16)

// What history keeps of a pixel.
KUAFU_CONST history_variance = 0u;
KUAFU_CONST history_launches = 1u;  // that its mean is of
KUAFU_CONST history_words = 2u;

struct DenoisePush {
  DenoiseImagesArray images;
  GuideArray guides;
  FloatArray moments;
  FloatArray light_in, light_out;  // [pixel][image][channel], over albedo; from denoise_multiply on times albedo
  PixelStatisticsArray pixels_in, pixels_out;
  SmoothStatisticsArray smoothed;
  UintArray squares;  // how many pixels are not square_plain, then which
  uint step, count;   // denoise_*; pixels of all views
  uint width, height;
  uint samples, spacing;  // samples 0: the images are filtered already
  uint lists;  // nonzero: squares is filled
  uint reserved;
};

/// Filtered light times what rays over the pixel's square meet, for the pixels of `squares`; or, before the filter, guides of all that they meet.
struct RemodulatePush {
  UintArray rays;  // sample_count of each pixel
  SceneReference scene;
  ViewArray views;
  DenoiseImagesArray images;
  GuideArray guides;
  FloatArray light;
  FloatArray light_out;  // as DenoisePush's
  PixelStatisticsArray pixels;
  WaveRange range;
  uint count;  // rays, or pixels that blend
  uint infrared;
  uint samples;  // of the image
  uint blends;
  UintArray squares_or_blended;  // of DenoisePush; or where blended guides go
};

#ifdef __cplusplus
static_assert(sizeof(GuidePush) == 112);
static_assert(sizeof(PlaceRecord) == 4 * place_words);
static_assert(sizeof(MomentsPush) == 72);
static_assert(sizeof(DenoiseImages) == 136);
static_assert(sizeof(PixelStatistics) == 16 && sizeof(SmoothStatistics) == 16);
static_assert(sizeof(DenoisePush) == 104);
static_assert(sizeof(RemodulatePush) == 128);
}  // namespace kuafu
#endif
#endif
