#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/alike.glsl"

layout(push_constant, scalar) uniform Push { DenoisePush push; };
#include "stage/denoise.glsl"

void main() {
  uint i = line_index();
  if (i < push.count) denoise(i);
}
