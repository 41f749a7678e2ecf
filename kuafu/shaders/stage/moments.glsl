// SPDX-License-Identifier: Apache-2.0
// Stage `moments`: sums of the samples of a wave, and of squares that tell the variance of their mean. Samples of one sequence spread better than at random, so that the
// scatter of single ones tells of more noise than there is; that of means of a quarter of the wave's hears of most of it.
const uint moments_read = 8u;  // samples read plane by plane: a cache's sector of 32 bytes at a time

/// Samples of a block, a power of two as the sequence has it.
uint block_size() {
  uint size = 1u;
  while (size * 8u <= push.range.sample_count) size *= 2u;
  return size;
}

void moments(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  uint word = ((pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column) * moment_words;
  float first = 0.0f, second = 0.0f, blocks = 0.0f, sum = 0.0f;
  uint size = block_size(), held = 0u;
  if (push.first_pass == 0u) {
    first = push.moments.at[word];
    second = push.moments.at[word + 1u];
    blocks = push.moments.at[word + 2u];
  }
  for (uint begin = 0u; begin < push.range.sample_count; begin += moments_read) {
    uint count = min(moments_read, push.range.sample_count - begin);
    float values[8];
    for (uint k = 0u; k < moments_read; ++k) values[k] = 0.0f;
    for (uint plane = push.channels; plane < push.groups * push.channels; ++plane) {  // the first group is the projectors' direct light
      uint at = (state_radiance(push.channels) + plane) * push.range.capacity + local_pixel * push.range.sample_count + begin;
      for (uint k = 0u; k < moments_read; ++k)
        if (k < count) values[k] += push.state.at[at + k];
    }
    for (uint k = 0u; k < count; ++k) {
      float value = values[k] / float(push.channels);
      first += value;
      sum += value;
      if (++held < size && begin + k + 1u < push.range.sample_count) continue;
      second += sum * sum / float(held);
      blocks += 1.0f;
      sum = 0.0f;
      held = 0u;
    }
  }
  push.moments.at[word] = first;
  push.moments.at[word + 1u] = second;
  push.moments.at[word + 2u] = blocks;
}
