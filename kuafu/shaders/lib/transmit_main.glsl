// Entry of both transmit shaders: one shadow ray per invocation.
#include "lib/invocation.glsl"
#include "lib/shading.glsl"

layout(push_constant, scalar) uniform Push { TransmitPush push; };
#include "stage/transmit.glsl"

void main() {
  uint i = gl_GlobalInvocationID.x, block = push.block_out * counter_words, end;
  Onward onward;
  onward.wanted = false;
  if (i < push.counters.at[push.block_in * counter_words + counter_shadow_count]) onward = transmit(i);
  uint place = append(onward.wanted, push.counters, block + counter_shadow_count, end);
  if (end > 0u && gl_LocalInvocationIndex == 0u) {
    cover(push.counters, block + counter_shadow_arguments, end, trace_group_size);
    cover(push.counters, block + counter_transmit_arguments, end, gl_WorkGroupSize.x);
  }
  if (onward.wanted) queue_onward(i, onward, place);
}
