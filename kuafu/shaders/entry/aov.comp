#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 3
#include "lib/invocation.glsl"
#include "lib/camera.glsl"
#include "lib/material.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { AovPush push; };
#include "stage/aov.glsl"

void main() {
  if (gl_GlobalInvocationID.x < push.range.pixel_count) aov(gl_GlobalInvocationID.x);
}
