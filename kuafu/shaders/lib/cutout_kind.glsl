// SPDX-License-Identifier: Apache-2.0
// What kinds of rays ask whether a surface is there (lib/cutout.glsl), beside cutout_closest and cutout_occluded.
#ifndef KUAFU_CUTOUT_KIND_GLSL
#define KUAFU_CUTOUT_KIND_GLSL
#include "shared/wave.h"

/// A search for bent light (stage/bend.glsl), which asks about one place again and again: it meets every surface that is there in part, and takes of the light
/// what that surface takes.
const uint cutout_search = 2u;

/// Of a ray that asks for its nearest hit, by its ray_id: shadow rays that glass may bend go through the same queues as paths.
uint closest_kind(uint id) { return (id & shadow_bends) != 0u ? cutout_search : cutout_closest; }
#endif
