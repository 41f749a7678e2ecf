// SPDX-License-Identifier: Apache-2.0
// Sums a pixel's paths in the order of their samples, and after the last pass writes the means into the output images.
float path_radiance(uint radiance_plane, uint local_pixel, uint s) {
  return push.state.at[(state_radiance(push.channels) + radiance_plane) * push.range.capacity + local_pixel * push.range.sample_count + s];
}

float pass_sum(uint radiance_plane, uint local_pixel) {
  float sum = 0.0f;
  for (uint s = 0u; s < push.range.sample_count; ++s) sum += path_radiance(radiance_plane, local_pixel, s);
  return sum;
}

/// Of all groups, over the pass's samples of one replicate.
float replicate_sum(uint channel, uint replicate, uint local_pixel) {
  float sum = 0.0f;
  uint first = (replicate + replicate_count - push.range.first_sample % replicate_count) % replicate_count;
  for (uint s = first; s < push.range.sample_count; s += replicate_count)
    for (uint group = 0u; group < push.groups; ++group) sum += path_radiance(group * push.channels + channel, local_pixel, s);
  return sum;
}

/// With the passes before.
float total(uint sum_plane, uint local_pixel, float sum) {
  uint word = sum_plane * push.sums_stride + push.sums_first + local_pixel;
  if ((push.flags & accumulate_continues) != 0u) sum += push.sums.at[word];
  if ((push.flags & accumulate_keeps) != 0u) push.sums.at[word] = sum;
  return sum;
}

void write_output(uint kind, Pixel pixel, uint channel, float value) {
  IN(OutputRecord) record = push.outputs.at[kind];
  if ((push.flags & accumulate_writes) != 0u && record.enabled != 0u)
    record.words.at[output_element(record, pixel, push.channels) + channel] = floatBitsToUint(value);
}

/// Samples of a replicate among the first `count` of the sequence.
uint replicate_size(uint replicate, uint count) { return (count + replicate_count - 1u - replicate) / replicate_count; }

/// Unbiased for the variance of `mean` where a replicate's mean varies as 1 / its size; infinite for a single replicate.
float variance_of_mean(uint channel, uint local_pixel, float mean) {
  float sum = 0.0f;
  uint used = 0u, end = push.first_sample + push.sample_count;
  for (uint r = 0u; r < replicate_count; ++r) {
    float replicate = total(push.groups * push.channels + channel * replicate_count + r, local_pixel, replicate_sum(channel, r, local_pixel));
    uint size = replicate_size(r, end) - replicate_size(r, push.first_sample);
    if (size == 0u) continue;
    float difference = replicate / float(size) - mean;
    sum += float(size) * difference * difference;
    ++used;
  }
  return used > 1u ? sum / (float(push.sample_count) * float(used - 1u)) : uintBitsToFloat(0x7f800000u);
}

void write_sample_count(Pixel pixel) {
  IN(OutputRecord) record = push.outputs.at[output_sample_count];
  if (record.enabled != 0u) record.words.at[output_element(record, pixel, 1u)] = push.sample_count;
}

void accumulate(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  for (uint c = 0u; c < push.channels; ++c) {
    float radiance = 0.0f, ambient = 0.0f;
    for (uint group = 0u; group < push.groups; ++group) {
      uint radiance_plane = group * push.channels + c;
      float mean = total(radiance_plane, local_pixel, pass_sum(radiance_plane, local_pixel)) * push.inverse_samples;
      radiance += mean;
      if (group >= group_ambient) ambient += mean;
      if (group == group_ambient) write_output(output_ambient_direct, pixel, c, mean);
      write_output(group < group_ambient ? output_radiance + 1u + group : output_light_group + group - group_ambient, pixel, c, mean);
    }
    write_output(output_radiance, pixel, c, radiance);
    write_output(output_radiance + 1u + group_ambient, pixel, c, ambient);
    for (uint group = push.groups; group < most_groups; ++group) write_output(output_light_group + group - group_ambient, pixel, c, 0.0f);
    if ((push.flags & accumulate_replicates) != 0u) write_output(output_variance, pixel, c, variance_of_mean(c, local_pixel, radiance));
  }
  if ((push.flags & accumulate_writes) != 0u) write_sample_count(pixel);
}
