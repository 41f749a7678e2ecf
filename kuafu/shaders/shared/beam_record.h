// SPDX-License-Identifier: Apache-2.0
// Light that bodies of smooth glass bend, followed from its light to where it lands (stage/follow.glsl), and the table in which vertices
// find what landed about them. Read by GLSL and C++ (scalar layout).
#ifndef KUAFU_BEAM_RECORD_H
#define KUAFU_BEAM_RECORD_H

#include "shared/scene_records.h"

#ifdef __cplusplus
namespace kuafu {
#endif

/// A grid of beams from a light without extent towards one body of glass: over the plane in front of the light at one metre, or across a
/// directional one.
struct BeamSource {
  vec3 origin;                // of a light's beams; of a directional one, the middle of its cross section before everything
  vec3 axis_u, axis_v, axis;  // unit
  vec2 first, step;           // of the nodes, along axis_u and axis_v: metres
  uint columns, first_beam;   // beam = first_beam + row * columns + column
  uint light, environment;
  uint instance;    // of the glass: what meets other glass first belongs to that one's own source
  uint flags;       // source_*
  uint key;         // of its beams' random numbers: its number in its environment, so that other environments change nothing
  int least_level;  // of cells: less than what no glass has bent takes up needs none of its own
};
KUAFU_CONST source_directional = 1u;
KUAFU_CONST source_turned =
    2u;  // of light that some surface reflects in part, by chance: a grid of its own, coarser, for it is little and goes anywhere
KUAFU_ARRAY(BeamSourceArray, BeamSource, 4)

KUAFU_CONST beam_surfaces_mask = 0xffu;  // of Beam.state: surfaces passed
KUAFU_CONST beam_bent = 0x100u;          // glass of a body was among them
KUAFU_CONST beam_turned = 0x200u;        // and reflected it, though not totally
KUAFU_CONST beam_landed = 0x400u;

/// One beam: on its way, then landed.
struct Beam {
  vec3 position;   // where its ray begins; landed: where it meets the surface
  vec3 direction;  // of travel, unit
  // How both change from a node of the grid to the next. Landed: the product of a point's offset and position_u, position_v is its place in
  // nodes; that with direction_u is how far it is off the surface, 1 as far as is taken to be the same; and direction_v lies along the
  // section, over half its length.
  vec3 position_u, position_v;
  vec3 direction_u, direction_v;
  vec3 lit, lit_u, lit_v;  // a point that is lit as the beam's end at the light is, and how it changes from node to node
  vec3 gain;               // what comes through; landed: irradiance across the light for one of 1 W/m^2 at `lit`
  float length_m, weight;  // of the way; a node's share of the light: solid angle, or area
  uint source, state;      // beam_*
  int level;               // of the table's cells: 2^level metres
  uint light, environment;
};
KUAFU_WRITTEN_ARRAY(BeamArray, Beam, 4)

// Words of the table: these, then (first entry, count) of each bucket, then entries: beams, ascending in each bucket; one that reaches it
// by several cells stands there as often.
KUAFU_CONST splat_used = 0u;    // entries
KUAFU_CONST splat_levels = 1u;  // bit (level - splat_least_level): some beam landed there
KUAFU_CONST splat_heads = 2u;   // lib/splat_table.glsl: head_word, entry_word
KUAFU_CONST splat_words_per_head = 2u;
KUAFU_CONST splat_entries_per_beam = 32u;  // on average at most: three times what is usual
KUAFU_CONST splat_most_cells_along = 16u;  // of a section, by how level_of chooses them
const int splat_least_level = -24, splat_most_level = 7;

struct SplatTable {
  BeamArray beams;
  UintArray words;
  uint buckets;  // a power of two
  uint beam_count;
  uint entries;  // that there is room for; a bucket that finds none is empty
  uint reserved;
};
KUAFU_ARRAY(SplatTableArray, SplatTable, 8)

/// Beams [first, first + count) on their way: one surface for all of them.
struct BeamPush {
  UintArray rays_in, rays_out;  // closest queues; ray_id is the beam
  UintArray environments_in, environments_out, counters;
  SceneReference scene;
  BeamSourceArray sources;
  BeamArray beams;
  uint source_count, first, count, capacity;
  uint block;     // of counters: that of rays_in
  uint surfaces;  // that a beam may pass
  uint flags;     // beam_environments, beam_medium
  uint key;       // of its random numbers, with each source's
  vec2 jitter;    // of all grids, in nodes
};
KUAFU_CONST beam_environments = 1u;  // rays carry an environment
KUAFU_CONST beam_medium = 2u;

/// A step over all buckets or all beams.
struct SplatTablePush {
  SplatTableArray table;
  uint step;
};
KUAFU_CONST splat_step_tally = 0u;  // beams: counts what each bucket will have
KUAFU_CONST splat_step_claim = 1u;  // buckets: gives each its entries
KUAFU_CONST splat_step_fill = 2u;   // beams
KUAFU_CONST splat_step_order = 3u;  // buckets: by beam, whichever came first
KUAFU_CONST splat_steps = 4u;

#ifdef __cplusplus
static_assert(sizeof(BeamSource) == 96);
static_assert(sizeof(Beam) == 148);
static_assert(sizeof(SplatTable) == 32);
static_assert(sizeof(BeamPush) == 104);
}  // namespace kuafu
#endif
#endif
