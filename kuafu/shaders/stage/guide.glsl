// Stage `guide`: what the ray through each pixel's centre met, as the denoiser compares it.
void store(uint word, float value) { push.guides.at[word] = floatBitsToUint(value); }
void store(uint word, vec3 value) {
  for (int i = 0; i < 3; ++i) push.guides.at[word + uint(i)] = floatBitsToUint(value[i]);
}

void guide(uint i) {
  Pixel pixel = wave_pixel(push.range, i);
  GuideRecord g = guide_of_ray(i, pixel.view);
  uint word = ((pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column) * 12u;
  store(word, g.normal);
  push.guides.at[word + 3u] = g.material;
  store(word + 4u, g.position);
  store(word + 7u, g.footprint_m);
  store(word + 8u, g.albedo);
  store(word + 11u, g.normal_exponent);
}
