// SPDX-License-Identifier: Apache-2.0
// Textures as shaders read them: linear RGBA in half or single precision, and a projector's pattern as one plane.
// Thread rule: pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "scene/scene.h"

namespace kuafu {

struct Texels {
  std::vector<uint32_t> words;
  uint32_t format = 0;  // texel_half4 or texel_float4
};

/// Returns linear texels. sRGB colour is decoded (IEC 61966-2-1); one channel is grey, two are grey and alpha. 8- and 16-bit texels become
/// halves, floats stay floats.
Texels linear_texels(const Texture& texture);

struct PatternPlane {
  std::vector<uint32_t> words;  // [height][width], packed from the low bits up
  uint32_t bits = 0;            // 8, 16: the stored integer; 32: a float
};

/// Returns the red channel as stored, without sRGB decoding.
PatternPlane pattern_plane(const Texture& texture);

}  // namespace kuafu
