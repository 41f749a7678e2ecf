// Bilinear reads of linear texels: material textures repeat, a projector's pattern is zero outside.
#ifndef KUAFU_TEXTURE_GLSL
#define KUAFU_TEXTURE_GLSL
#include "shared/scene_records.h"

vec4 texel(TextureRecord t, uint x, uint y) {
  uint i = y * t.width + x;
  if (t.format == texel_half4) return vec4(unpackHalf2x16(t.texels.at[2u * i]), unpackHalf2x16(t.texels.at[2u * i + 1u]));
  i *= 4u;
  return uintBitsToFloat(uvec4(t.texels.at[i], t.texels.at[i + 1u], t.texels.at[i + 2u], t.texels.at[i + 3u]));
}

/// uv in [0,1] covers the image; v grows downwards.
vec4 texture_repeat(TextureRecord t, vec2 uv) {
  vec2 size = vec2(t.width, t.height);
  vec2 p = fract(uv) * size - 0.5f;
  vec2 base = floor(p);
  vec2 f = p - base;
  uint x0 = base.x < 0.0f ? t.width - 1u : uint(base.x), y0 = base.y < 0.0f ? t.height - 1u : uint(base.y);
  uint x1 = x0 + 1u >= t.width ? 0u : x0 + 1u, y1 = y0 + 1u >= t.height ? 0u : y0 + 1u;
  return mix(mix(texel(t, x0, y0), texel(t, x1, y0), f.x), mix(texel(t, x0, y1), texel(t, x1, y1), f.x), f.y);
}

float pattern_texel(FloatArray pattern, int x, int y, int width, int height) {
  bool inside = x >= 0 && y >= 0 && x < width && y < height;
  return inside ? pattern.at[uint(y) * uint(width) + uint(x)] : 0.0f;
}

/// Pixel centres at integers; exactly the bilinear interpolation of the image padded with zeros.
float pattern_bilinear(FloatArray pattern, vec2 pixel, uint width, uint height) {
  if (!(pixel.x > -1.0f && pixel.y > -1.0f && pixel.x < float(width) && pixel.y < float(height))) return 0.0f;
  vec2 base = floor(pixel), f = pixel - base;
  int x = int(base.x), y = int(base.y), w = int(width), h = int(height);
  float top = mix(pattern_texel(pattern, x, y, w, h), pattern_texel(pattern, x + 1, y, w, h), f.x);
  float bottom = mix(pattern_texel(pattern, x, y + 1, w, h), pattern_texel(pattern, x + 1, y + 1, w, h), f.x);
  return mix(top, bottom, f.y);
}
#endif
