// SPDX-License-Identifier: Apache-2.0
// to[i] = from[i] * factor * multiplier: the smallest work that uses addresses, push constants and a specialisation constant.
#version 460
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 64) in;
layout(constant_id = 0) const uint factor = 1;
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer Words {
  uint at[];
};
layout(push_constant, scalar) uniform Push {
  Words from;
  Words to;
  uint count;
  uint multiplier;
}
push;
void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i < push.count) push.to.at[i] = push.from.at[i] * factor * push.multiplier;
}
