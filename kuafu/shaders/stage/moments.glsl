// Stage `moments`: sums of the samples of a wave and of their squares.
void moments(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  uint word = ((pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column) * 2u;
  float first = 0.0f, second = 0.0f;
  if (push.first_pass == 0u) {
    first = push.moments.at[word];
    second = push.moments.at[word + 1u];
  }
  for (uint s = 0u; s < push.range.sample_count; ++s) {
    float value = 0.0f;
    for (uint plane = push.channels; plane < push.groups * push.channels; ++plane)  // the first group is the projectors' direct light
      value += push.state.at[(state_radiance(push.channels) + plane) * push.range.capacity + local_pixel * push.range.sample_count + s];
    value /= float(push.channels);
    first += value;
    second += value * value;
  }
  push.moments.at[word] = first;
  push.moments.at[word + 1u] = second;
}
