// SPDX-License-Identifier: Apache-2.0
// Stage `moments`: sums of the samples of a wave and of their squares.
const uint moments_block = 8u;  // samples read plane by plane: a cache's sector of 32 bytes at a time

void moments(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  uint word = ((pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column) * 2u;
  float first = 0.0f, second = 0.0f;
  if (push.first_pass == 0u) {
    first = push.moments.at[word];
    second = push.moments.at[word + 1u];
  }
  for (uint begin = 0u; begin < push.range.sample_count; begin += moments_block) {
    uint count = min(moments_block, push.range.sample_count - begin);
    float values[8];
    for (uint k = 0u; k < moments_block; ++k) values[k] = 0.0f;
    for (uint plane = push.channels; plane < push.groups * push.channels; ++plane) {  // the first group is the projectors' direct light
      uint at = (state_radiance(push.channels) + plane) * push.range.capacity + local_pixel * push.range.sample_count + begin;
      for (uint k = 0u; k < moments_block; ++k)
        if (k < count) values[k] += push.state.at[at + k];
    }
    for (uint k = 0u; k < moments_block; ++k) {
      float value = values[k] / float(push.channels);
      first += value;
      second += value * value;
    }
  }
  push.moments.at[word] = first;
  push.moments.at[word + 1u] = second;
}
