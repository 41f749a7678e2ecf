// SPDX-License-Identifier: Apache-2.0
// One channel (infrared) or three (visible); the entry file defines KUAFU_CHANNELS. Records hold three in both bands: band_of takes those that there are.
#ifndef KUAFU_SPECTRUM_GLSL
#define KUAFU_SPECTRUM_GLSL

#if KUAFU_CHANNELS == 1
#define Spectrum float
Spectrum band_of(vec3 value) { return value.x; }
float channel_of(Spectrum s, uint c) { return s; }
float max_component(Spectrum s) { return s; }
Spectrum band_exp(Spectrum s) { return exp(s); }
#else
#define Spectrum vec3
Spectrum band_of(vec3 value) { return value; }
float channel_of(Spectrum s, uint c) { return s[c]; }
float max_component(Spectrum s) { return max(s.x, max(s.y, s.z)); }
Spectrum band_exp(Spectrum s) { return vec3(exp(s.x), exp(s.y), exp(s.z)); }
#endif
const uint channels = KUAFU_CHANNELS;
#endif
