// SPDX-License-Identifier: Apache-2.0
// Bilinear reads of linear texels: material textures repeat, a projector's pattern is zero outside.
#ifndef KUAFU_TEXTURE_GLSL
#define KUAFU_TEXTURE_GLSL
#include "lib/language.glsl"
#include "shared/scene_records.h"

vec4 texel(IN(TextureRecord) t, uint x, uint y) {
  uint i = y * t.width + x;
  if (t.format == texel_half4) return vec4(unpackHalf2x16(t.texels.at[2u * i]), unpackHalf2x16(t.texels.at[2u * i + 1u]));
  i *= 4u;
  return uintBitsToFloat(uvec4(t.texels.at[i], t.texels.at[i + 1u], t.texels.at[i + 2u], t.texels.at[i + 3u]));
}

/// uv in [0,1] covers the image; v grows downwards. A uv that is no number reads some texel of the image.
vec4 texture_repeat(IN(TextureRecord) t, vec2 uv) {
  vec2 size = vec2(t.width, t.height);
  vec2 p = fract(uv) * size - 0.5f;
  vec2 base = floor(p);
  vec2 f = p - base;
  uint x0 = base.x < 0.0f ? t.width - 1u : min(uint(base.x), t.width - 1u);
  uint y0 = base.y < 0.0f ? t.height - 1u : min(uint(base.y), t.height - 1u);
  uint x1 = x0 + 1u >= t.width ? 0u : x0 + 1u, y1 = y0 + 1u >= t.height ? 0u : y0 + 1u;
  return mix(mix(texel(t, x0, y0), texel(t, x1, y0), f.x), mix(texel(t, x0, y1), texel(t, x1, y1), f.x), f.y);
}

struct Pattern {
  UintArray words;
  uint width, height, bits;
};

float pattern_texel(IN(Pattern) p, int x, int y) {
  if (x < 0 || y < 0 || x >= int(p.width) || y >= int(p.height)) return 0.0f;
  uint i = uint(y) * p.width + uint(x);
  if (p.bits == 8u) return float((p.words.at[i >> 2] >> ((i & 3u) * 8u)) & 0xffu) / 255.0f;
  if (p.bits == 16u) return float((p.words.at[i >> 1] >> ((i & 1u) * 16u)) & 0xffffu) / 65535.0f;
  return uintBitsToFloat(p.words.at[i]);
}

/// Pixel centres at integers; exactly the bilinear interpolation of the image padded with zeros.
float pattern_bilinear(IN(Pattern) p, vec2 pixel) {
  if (!(pixel.x > -1.0f && pixel.y > -1.0f && pixel.x < float(p.width) && pixel.y < float(p.height))) return 0.0f;
  vec2 base = floor(pixel), f = pixel - base;
  int x = int(base.x), y = int(base.y);
  float top = mix(pattern_texel(p, x, y), pattern_texel(p, x + 1, y), f.x);
  float bottom = mix(pattern_texel(p, x, y + 1), pattern_texel(p, x + 1, y + 1), f.x);
  return mix(top, bottom, f.y);
}
#endif
