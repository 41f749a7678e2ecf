// SPDX-License-Identifier: Apache-2.0
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/invocation.glsl"
#include "lib/distortion.glsl"
#include "shared/optics_record.h"

layout(push_constant, scalar) uniform Push { OpticsPush push; };
layout(constant_id = 4) const uint step = optics_vignetting;
#include "stage/optics.glsl"

void main() {
  uint i = line_index();
  if (i < push.count) optics(i);
}
