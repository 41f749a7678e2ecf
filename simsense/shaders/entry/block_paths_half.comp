// SPDX-License-Identifier: Apache-2.0
// Path costs of block sums with packed half-float minima: where the device has them and the costs' range fits.
#version 460
#extension GL_GOOGLE_include_directive : require
#define HALF_MIN
#include "lib/block_paths.glsl"
