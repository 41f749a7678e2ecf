// Sums a pixel's paths in the order of their samples, and after the last pass writes the means into the caller's images.
float pass_sum(uint radiance_plane, uint local_pixel) {
  uint word = (state_radiance(push.channels) + radiance_plane) * push.range.capacity + local_pixel * push.range.sample_count;
  float sum = 0.0f;
  for (uint s = 0u; s < push.range.sample_count; ++s) sum += push.state.at[word + s];
  return sum;
}

void write_output(uint kind, Pixel pixel, uint channel, float value) {
  OutputRecord record = push.outputs.at[kind];
  if (record.enabled != 0u) record.words.at[output_element(record, pixel, push.channels) + channel] = floatBitsToUint(value);
}

void accumulate(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  for (uint c = 0u; c < push.channels; ++c) {
    float radiance = 0.0f, ambient = 0.0f;
    for (uint group = 0u; group < push.groups; ++group) {
      uint radiance_plane = group * push.channels + c, word = radiance_plane * push.range.pixel_count + local_pixel;
      float sum = pass_sum(radiance_plane, local_pixel);
      if (push.first_pass == 0u) sum += push.sums.at[word];
      if (push.last_pass == 0u) push.sums.at[word] = sum;
      sum *= push.inverse_samples;
      radiance += sum;
      if (group >= group_ambient) ambient += sum;
      if (push.last_pass != 0u) write_output(group < group_ambient ? output_radiance + 1u + group : output_light_group + group - group_ambient, pixel, c, sum);
    }
    if (push.last_pass == 0u) continue;
    write_output(output_radiance, pixel, c, radiance);
    write_output(output_radiance + 1u + group_ambient, pixel, c, ambient);
    for (uint group = push.groups; group < most_groups; ++group) write_output(output_light_group + group - group_ambient, pixel, c, 0.0f);
  }
}
