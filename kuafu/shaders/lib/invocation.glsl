// What only GLSL has: the workgroup, specialisation constants, and places in a queue taken by one atomic per subgroup.
#ifndef KUAFU_INVOCATION_GLSL
#define KUAFU_INVOCATION_GLSL
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_ballot : require
#include "shared/wave.h"

layout(local_size_x_id = 0) in;
layout(constant_id = 1) const uint queue_layout = queue_layout_planes;
layout(constant_id = 2) const uint trace_group_size = 32u;

/// Raises the indirect dispatch at `word` to one that covers `count` invocations.
void cover(UintArray counters, uint word, uint count, uint group_size) {
  atomicMax(counters.at[word], (count + group_size - 1u) / group_size);
  counters.at[word + 1u] = 1u;
  counters.at[word + 2u] = 1u;
}

/// Reserves a place for each invocation that wants one. `end` is one past the subgroup's last, 0 when it wants none. Call in uniform control flow.
uint append(bool wanted, UintArray counters, uint count_word, out uint end) {
  uvec4 ballot = subgroupBallot(wanted);
  uint count = subgroupBallotBitCount(ballot);
  uint base = 0u;
  if (subgroupElect() && count > 0u) base = atomicAdd(counters.at[count_word], count);
  base = subgroupBroadcastFirst(base);
  end = count > 0u ? base + count : 0u;
  return base + subgroupBallotExclusiveBitCount(ballot);
}
#endif
