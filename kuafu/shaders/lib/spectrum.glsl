// SPDX-License-Identifier: Apache-2.0
// One channel (infrared) or three (visible); the entry file defines KUAFU_CHANNELS. Records hold three in both bands: band_of takes those that there are.
#ifndef KUAFU_SPECTRUM_GLSL
#define KUAFU_SPECTRUM_GLSL
#include "lib/language.glsl"

#if KUAFU_CHANNELS == 1
#define Spectrum float
Spectrum band_of(vec3 value) { return value.x; }
float channel_of(Spectrum s, uint c) { return s; }
void set_channel(INOUT(Spectrum) s, uint c, float value) { s = value; }
float max_component(Spectrum s) { return s; }
float mean_component(Spectrum s) { return s; }
Spectrum band_exp(Spectrum s) { return exp(s); }
#else
#define Spectrum vec3
Spectrum band_of(vec3 value) { return value; }
float channel_of(Spectrum s, uint c) { return s[c]; }
void set_channel(INOUT(Spectrum) s, uint c, float value) { s[c] = value; }
float max_component(Spectrum s) { return max(s.x, max(s.y, s.z)); }
float mean_component(Spectrum s) { return (s.x + s.y + s.z) * (1.0f / 3.0f); }
Spectrum band_exp(Spectrum s) { return vec3(exp(s.x), exp(s.y), exp(s.z)); }
#endif
const uint channels = KUAFU_CHANNELS;
#endif
