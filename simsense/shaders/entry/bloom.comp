// SPDX-License-Identifier: Apache-2.0
// Full wells that overflow into their column (cpu/signal/blooming.cpp): an invocation walks down and up one column.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "shared/signal_push.h"

layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform Push { SignalPush push; };

/// What one pixel's room takes from the charge that flows by.
float absorb(float charge, inout float flow, float full_well) {
  float taken = min(flow, max(full_well - charge, 0.0f));
  flow -= taken;
  return charge + taken;
}

void main() {
  SignalParameters p = push.block.head.parameters;
  uint x = gl_GlobalInvocationID.x, first = gl_WorkGroupID.z * p.height * p.pitch + x;
  if (x >= p.width) return;
  float flow = 0.0f;
  for (uint y = 0u; y < p.height; ++y) {
    float charge = absorb(p.charge.at[first + y * p.pitch], flow, p.full_well_e);
    p.charge.at[first + y * p.pitch] = charge;  // above the full well until both flows have taken their halves
    flow += 0.5f * p.bloom_share * max(charge - p.full_well_e, 0.0f);
  }
  flow = 0.0f;
  for (uint y = p.height; y-- > 0u;) {
    float charge = absorb(p.charge.at[first + y * p.pitch], flow, p.full_well_e);
    flow += 0.5f * p.bloom_share * max(charge - p.full_well_e, 0.0f);
    p.charge.at[first + y * p.pitch] = min(charge, p.full_well_e);
  }
}
