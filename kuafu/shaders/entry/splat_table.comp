// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
// One beam or one bucket per invocation.
#include "lib/invocation.glsl"
#include "lib/frame.glsl"

layout(push_constant, scalar) uniform Push { SplatTablePush push; };
#include "stage/splat_table.glsl"

void main() { table_step(gl_GlobalInvocationID.x); }
