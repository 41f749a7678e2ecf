// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// Built once for each band (KUAFU_CHANNELS): one shadow ray per invocation.
#include "lib/invocation.glsl"
#include "lib/shading.glsl"

layout(push_constant, scalar) uniform Push { TransmitPush push; };
#include "stage/transmit.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x, block = push.block_out * counter_words, count = push.counters.at[push.block_in * counter_words + counter_shadow_count];
  Onward onward;
  onward.wanted = false;
  if (i == 0u && push.last == 0u) {
    cover_rays(push.counters, block + counter_shadow_arguments, count);
    cover(push.counters, block + counter_transmit_arguments, count);
  }
  if (i < count) onward = transmit(i);
  uint place = append(onward.wanted, push.counters, block + counter_shadow_count);
  if (onward.wanted) queue_onward(i, onward, place);
}
