// SPDX-License-Identifier: Apache-2.0
// How many planes of light a pixel has, all images and channels: a constant of the pipeline, so that arrays of them lie in registers. Above it, the
// step of stages that have several.
layout(constant_id = 4) const uint planes_and_step = 1u;
uint plane_count() { return planes_and_step & 0xffu; }
uint denoise_step() { return planes_and_step >> 8u; }
