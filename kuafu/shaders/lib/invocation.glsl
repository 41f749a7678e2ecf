// SPDX-License-Identifier: Apache-2.0
// What only GLSL has: the workgroup, specialisation constants, and places in a queue.
#ifndef KUAFU_INVOCATION_GLSL
#define KUAFU_INVOCATION_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "shared/wave.h"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint queue_layout = queue_layout_planes;
layout(constant_id = 2) const uint trace_group_size = 32u;
layout(constant_id = 3) const uint features = 0u;
layout(constant_id = 5) const uint spread_groups = 0u;  // of a tracer: Tracer::spread_groups

/// Number of this invocation in a line of groups, which may stand in rows (ks::Commands::dispatch_line).
uint line_index() { return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x; }

/// Sets the indirect dispatch at `word` to one of so many groups. By one invocation, and for as many as there can be: queues are filled by atomics enough.
void set_groups(UintArray counters, uint word, uint groups) {
  counters.at[word] = groups;
  counters.at[word + 1u] = 1u;
  counters.at[word + 2u] = 1u;
}

/// A stage over at most `count`.
void cover(UintArray counters, uint word, uint count) { set_groups(counters, word, (count + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x); }

/// The same of a tracer, which gives few rays more groups than they fill.
void cover_rays(UintArray counters, uint word, uint count) {
  set_groups(counters, word, max((count + trace_group_size - 1u) / trace_group_size, min(count, spread_groups)));
}

shared uint wanted_count, first_place;

/// Reserves a place for each invocation that wants one, with one atomic of the queue per workgroup. All invocations of the workgroup must call it.
uint append(bool wanted, UintArray counters, uint count_word) {
  if (gl_LocalInvocationIndex == 0u) wanted_count = 0u;
  barrier();
  uvec4 ballot = subgroupBallot(wanted);
  uint place = 0u;
  if (subgroupElect()) place = atomicAdd(wanted_count, subgroupBallotBitCount(ballot));
  place = subgroupBroadcastFirst(place) + subgroupBallotExclusiveBitCount(ballot);
  barrier();
  if (gl_LocalInvocationIndex == 0u && wanted_count > 0u) first_place = atomicAdd(counters.at[count_word], wanted_count);
  barrier();
  place += first_place;
  barrier();
  return place;
}
#endif
