// SPDX-License-Identifier: Apache-2.0
// The imager (simsense_signal) for four neighbouring pixels per invocation, whose words share a Philox block: light to charge, charge to
// counts, or both.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/image.glsl"
#include "lib/signal/collect.glsl"
#include "lib/signal/readout.glsl"

layout(local_size_x = 32, local_size_y = 4) in;
layout(push_constant, scalar) uniform Push { SignalPush push; };

vec4 load_light(ImageRef image, uint n, uint quad, uint y, uint width) {
  vec4 light = vec4(0.0f);
  if (image.format == 0u) return light;
  [[unroll]] for (uint i = 0u; i < 4u; ++i) light[i] = load_element(image, element_of(image, n, min(4u * quad + i, width - 1u), y));
  return light;
}

void store(uint n, uint quad, uint y, uint width, uvec4 counts) {
  [[unroll]] for (uint i = 0u; i < 4u; ++i) {
    uint x = 4u * quad + i;
    if (x >= width) break;
    if (push.counts.format != 0u) store_counts(push.counts, element_of(push.counts, n, x, y), counts[i]);
    if (push.ir.format != 0u) store_counts(push.ir, element_of(push.ir, n, x, y), counts[i]);
  }
}

void main() {
  uint quad = gl_GlobalInvocationID.x, y = gl_GlobalInvocationID.y, n = gl_WorkGroupID.z;
  SignalParameters p = push.block.head.parameters;
  if (4u * quad >= p.width || y >= p.height) return;
  uint at = (n * p.height + y) * p.pitch + 4u * quad;
  vec4 charge;
  if ((push.passes & SIGNAL_COLLECT) != 0u) {
    charge = collect(push.block, load_light(push.light, n, quad, y, p.width), load_light(p.laser, n, quad, y, p.width), n, quad, y);
  } else {
    [[unroll]] for (uint i = 0u; i < 4u; ++i) charge[i] = p.charge.at[at + i];
  }
  if ((push.passes & SIGNAL_READ_OUT) != 0u) {
    store(n, quad, y, p.width, read_out(p, push.block.head.keys[n], charge, quad, y));
  } else {
    [[unroll]] for (uint i = 0u; i < 4u; ++i) p.charge.at[at + i] = charge[i];
  }
}
