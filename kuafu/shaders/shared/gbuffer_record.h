// SPDX-License-Identifier: Apache-2.0
// Light on the surfaces that another renderer saw: what its stage reads and writes, read by GLSL and C++ (scalar layout). Images are packed
// [environment][row][column][channel].
#ifndef KUAFU_GBUFFER_RECORD_H
#define KUAFU_GBUFFER_RECORD_H

#include "shared/wave.h"

#ifdef __cplusplus
namespace kuafu {
#endif

// The steps, in their order.
KUAFU_CONST gbuffer_read = 0u;      // per pixel that was given: checked, its depth inverted
KUAFU_CONST gbuffer_between = 1u;   // per pixel of the right camera's view and the projector's, which were not given: what lands between
KUAFU_CONST gbuffer_middles = 2u;   // the same: what lands on a pixel's middle
KUAFU_CONST gbuffer_warp = 3u;      // the same: what is seen
KUAFU_CONST gbuffer_light = 4u;     // per pixel of both cameras
KUAFU_CONST gbuffer_cells = 5u;     // per cell of the left camera
KUAFU_CONST gbuffer_sky = 6u;       // the same
KUAFU_CONST gbuffer_smooth = 7u;    // the same
KUAFU_CONST gbuffer_bounce = 8u;    // per pixel of both cameras; devices list those with lobes
KUAFU_CONST gbuffer_lobes = 9u;     // devices: over those
KUAFU_CONST gbuffer_blend = 10u;    // per pixel of both cameras
KUAFU_CONST gbuffer_average = 11u;  // per pixel of both imagers, under supersampling

// GbufferCamera.given
KUAFU_CONST gbuffer_has_depth = 1u;
KUAFU_CONST gbuffer_has_normal = 2u;
KUAFU_CONST gbuffer_has_albedo = 4u;
KUAFU_CONST gbuffer_has_material = 8u;

// What is wrong with a pixel: the low bits of a word of GbufferRecord.errors, above which its number stands.
KUAFU_CONST gbuffer_error_bits = 4u;  // what, and above of which image: left, right, projector
KUAFU_CONST gbuffer_bad_depth = 0u;
KUAFU_CONST gbuffer_bad_normal = 1u;
KUAFU_CONST gbuffer_bad_albedo = 2u;
KUAFU_CONST gbuffer_bad_material = 3u;
KUAFU_CONST gbuffer_no_error = 0xffffffffu;

KUAFU_CONST gbuffer_cell_px = 4u;          // on a side of the cells in which light between surfaces is found
KUAFU_CONST gbuffer_horizon_sides = 8u;    // of slices through a cell, two of each
KUAFU_CONST gbuffer_horizon_steps = 10u;   // along each
KUAFU_CONST gbuffer_mirror_steps = 12u;    // of rays that lobes look along
KUAFU_CONST gbuffer_mirror_halvings = 3u;  // of the last

/// What surfaces near one another exchange, by cell: of the room's radiance as a share, of surfaces' laser as a radiance. What is needed
/// together is one vector.
struct GbufferCell {
  vec4 plane;                      // normal, in the camera; metres of all points of its plane, along it
  vec4 own;                        // the mean radiance of the projector's light, and what is reflected; at the image's border: what 1/m
                                   // changes by past it, per cell along columns and rows
  vec4 sent;                       // 1/m; what is sent of the room, and of laser
  vec2 arriving, smooth_arriving;  // of both; mixed with neighbours of the same surface
};
KUAFU_WRITTEN_ARRAY(GbufferCells, GbufferCell, 16)

/// A projector's pattern as pixels of one size see it: [level][row][column], each level through beams as wide as pattern_level has them.
struct PatternMeans {
  FloatArray means;
  uint width, height, levels;
  float step_px;  // of the pattern, between two means
};

/// One camera, in all environments.
struct GbufferCamera {
  FloatArray depth, normal, albedo;  // as given
  UintArray material;
  FloatArray inverse_depth;  // 1/m, 0 where nothing is
  UintArray source;          // of a view that was not given: the left camera's pixel whose surface is there
  ViewRecord view;
  vec3 axis_x, axis_y, axis_z;  // of the camera, in the world
  vec2 focal, centre;
  uint given;            // gbuffer_has_*
  float projector_px_m;  // focal length times the way to the projector, along a row
  float shift_px;        // of the principal point, to the right of the left camera's
};

struct GbufferRecord {
  GbufferCamera cameras[2];
  FloatArray projector_depth;     // as a camera like the left one sees it from the projector's place
  FloatArray projector_inverse;   // 1/m
  FloatArray power, ambient;      // by environment: over the projector's intensity; the room's radiance, W/(sr m^2)
  UintArray errors;               // by environment: the least word of what is wrong, or gbuffer_no_error
  UintArray material_places;      // by 1 + a material's id: its place in the scene's table, 0 where it was removed
  UintArray measured_albedo;      // by place: nonzero where it has an infrared albedo
  UintArray between, middles;     // [right camera, projector][environment][row][place]: the last pixel there, or 0; later matt and lobes
  FloatArray matt, lobes, laser;  // [camera][environment][row][column]: shares of light from all sides that are reflected; radiance
  FloatArray room;                // the same, of the room's light; in the place of `matt`
  UintArray lobe_pixels;          // how many with strong and weak lobes, and their numbers
  GbufferCells cells;             // of the left camera, [environment][row][column]
  OutputArray outputs, averaged;  // by pixel of G-buffers and, under supersampling, by pixel of the imagers
  SceneReference scene;
  PatternMeans pattern;
  uint width, height, environments, materials;  // of material_places
  uint cell_columns, cell_rows;
  uint along_rays;  // nonzero: depths are distances from the camera's centre
  uint projector_depth_given;
  uint has_projector;   // nonzero: some light is one
  uint supersampling;   // pixels of G-buffers along each side of an imager's pixel
  uint laser_as_one;    // nonzero: what the projector sends straight and by other surfaces is one image
  float baseline_px_m;  // focal length times baseline
  float focal_px;
};
KUAFU_ARRAY(GbufferArray, GbufferRecord, 8)

struct GbufferPush {
  GbufferArray record;
  uint step, count;  // gbuffer_*; invocations
};

#ifdef __cplusplus
static_assert(sizeof(GbufferCell) == 64);
static_assert(sizeof(GbufferCamera) == 176);
static_assert(sizeof(GbufferRecord) == 576);
static_assert(sizeof(GbufferPush) == 16);
}  // namespace kuafu
#endif
#endif
