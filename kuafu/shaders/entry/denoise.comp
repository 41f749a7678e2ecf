#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/alike.glsl"

layout(push_constant, scalar) uniform Push { DenoisePush push; };
#include "stage/denoise.glsl"

void main() {
  if (gl_GlobalInvocationID.x < push.count) denoise(gl_GlobalInvocationID.x);
}
