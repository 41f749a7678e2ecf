#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 3
#include "lib/invocation.glsl"
#include "lib/alike.glsl"
#include "lib/material.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { RemodulatePush push; };
#include "lib/guide.glsl"
#include "stage/blend.glsl"
#include "stage/remodulate.glsl"

void main() {
  if (gl_GlobalInvocationID.x >= push.count) return;
  if (push.blends != 0u) blend(gl_GlobalInvocationID.x);
  else remodulate(gl_GlobalInvocationID.x);
}
