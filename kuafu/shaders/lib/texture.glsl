// SPDX-License-Identifier: Apache-2.0
// Reads of linear texels: of material textures as their records say, of a projector's pattern, which is zero outside.
#ifndef KUAFU_TEXTURE_GLSL
#define KUAFU_TEXTURE_GLSL
#include "lib/language.glsl"
#include "shared/wave.h"

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

/// Number of texel i on an axis of `count`, where a wrapped coordinate's texels go from -1 to 2 count.
uint wrapped_texel(int i, uint count, uint wrap) {
  int n = int(count);
  if (wrap == wrap_repeat) i = i < 0 ? n - 1 : i >= n ? 0 : i;
  if (wrap == wrap_mirror) {
    i = i < 0 ? -1 - i : i;
    i = i >= n ? 2 * n - 1 - i : i;
    i = i < 0 ? 0 : i;
  }
  return uint(clamp(i, 0, n - 1));
}

/// A coordinate brought to where wrapped_texel takes it: [0, 1], or [0, 2) of a mirrored axis.
float wrapped_coordinate(float u, uint wrap) {
  if (wrap == wrap_mirror) return 2.0f * fract(0.5f * u);
  return wrap == wrap_clamp ? clamp(u, 0.0f, 1.0f) : fract(u);
}

/// texture_repeat for every wrap and filter.
vec4 texture_wrapped(IN(TextureRecord) t, vec2 uv) {
  uint wrap_u = t.lookup & lookup_wrap_mask, wrap_v = t.lookup >> lookup_wrap_v_shift & lookup_wrap_mask;
  bool nearest = (t.lookup & lookup_nearest) != 0u;
  vec2 p = vec2(wrapped_coordinate(uv.x, wrap_u), wrapped_coordinate(uv.y, wrap_v)) * vec2(t.width, t.height) - (nearest ? 0.0f : 0.5f);
  vec2 base = floor(p);
  vec2 f = p - base;
  int x = int(base.x), y = int(base.y);
  uint x0 = wrapped_texel(x, t.width, wrap_u), y0 = wrapped_texel(y, t.height, wrap_v);
  if (nearest) return texel(t, x0, y0);
  uint x1 = wrapped_texel(x + 1, t.width, wrap_u), y1 = wrapped_texel(y + 1, t.height, wrap_v);
  return mix(mix(texel(t, x0, y0), texel(t, x1, y0), f.x), mix(texel(t, x0, y1), texel(t, x1, y1), f.x), f.y);
}

/// Where a surface's textures are read.
struct TexturePlace {
  vec2 uv, uv_1;
};

/// What a material's texture has there; white where there is none.
vec4 material_texel(IN(SceneAddresses) scene, uint texture, IN(TexturePlace) place) {
  if (texture == no_texture) return vec4(1.0f);
  IN(TextureRecord) t = scene.textures.at[texture];
  if ((features & feature_lookups) == 0u || t.lookup == 0u) return texture_repeat(t, place.uv);
  vec2 uv = (t.lookup & lookup_uv_1) != 0u ? place.uv_1 : place.uv;
  if ((t.lookup & lookup_transform) != 0u) uv = vec2(dot(t.transform[0], vec3(uv, 1.0f)), dot(t.transform[1], vec3(uv, 1.0f)));
  return texture_wrapped(t, uv);
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
