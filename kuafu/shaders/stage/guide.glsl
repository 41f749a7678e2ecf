// SPDX-License-Identifier: Apache-2.0
// Stage `guide`: what the ray through each pixel's centre met, as the denoiser compares it.
void store_place(uint index, PlaceRecord place) {
  uint word = index * place_words;
  for (int k = 0; k < 3; ++k) {
    push.places.at[word + uint(k)] = floatBitsToUint(place.position[k]);
    push.places.at[word + 3u + uint(k)] = floatBitsToUint(place.normal[k]);
  }
  push.places.at[word + 6u] = floatBitsToUint(place.image_point.x);
  push.places.at[word + 7u] = floatBitsToUint(place.image_point.y);
  push.places.at[word + 8u] = place.instance;
}

void guide(uint i) {
  Pixel pixel = wave_pixel(push.range, i);
  GuideRecord g = guide_of_ray(i, pixel.view);
  uint index = (pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column;
  store_guide(push.guides, index, g);
  if (push.history != 0u) store_place(index, place_of_ray(i, pixel.view, g));
}
