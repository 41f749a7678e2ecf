// SPDX-License-Identifier: Apache-2.0
// Path costs with integer minima: any device, any range.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/paths.glsl"
