// SPDX-License-Identifier: Apache-2.0
#version 460
// Nothing hit.
#extension GL_GOOGLE_include_directive : require
#include "lib/rt_hit.glsl"
#include "shared/ray_queue.h"

layout(location = 0) rayPayloadInEXT RtHit hit;

void main() { hit.instance = miss; }
