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

/// Number of this invocation in a line of groups, which may stand in rows (ks::Commands::dispatch_line).
uint line_index() { return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * gl_WorkGroupSize.x + gl_LocalInvocationID.x; }

/// Raises the indirect dispatch at `word` to one that covers `count` invocations.
void cover(UintArray counters, uint word, uint count, uint group_size) {
  atomicMax(counters.at[word], (count + group_size - 1u) / group_size);
  counters.at[word + 1u] = 1u;
  counters.at[word + 2u] = 1u;
}

shared uint wanted_count, first_place;

/// Reserves a place for each invocation that wants one, with one atomic of the queue per workgroup. `end` is one past the workgroup's last, 0 when it
/// wants none. All invocations of the workgroup must call it.
uint append(bool wanted, UintArray counters, uint count_word, out uint end) {
  if (gl_LocalInvocationIndex == 0u) wanted_count = 0u;
  barrier();
  uvec4 ballot = subgroupBallot(wanted);
  uint place = 0u;
  if (subgroupElect()) place = atomicAdd(wanted_count, subgroupBallotBitCount(ballot));
  place = subgroupBroadcastFirst(place) + subgroupBallotExclusiveBitCount(ballot);
  barrier();
  if (gl_LocalInvocationIndex == 0u && wanted_count > 0u) first_place = atomicAdd(counters.at[count_word], wanted_count);
  barrier();
  end = wanted_count > 0u ? first_place + wanted_count : 0u;
  place += first_place;
  barrier();
  return place;
}
#endif
