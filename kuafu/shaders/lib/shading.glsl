// SPDX-License-Identifier: Apache-2.0
// Everything that stage/shade.glsl stands on.
#include "lib/bsdf.glsl"
#include "lib/frame.glsl"
#include "lib/light.glsl"
#include "lib/light_motion.glsl"
#include "lib/light_shape.glsl"
#include "lib/medium.glsl"
#include "lib/queue.glsl"
#include "lib/sequence.glsl"
