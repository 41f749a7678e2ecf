// One invocation per pixel: sums its paths in the order of their samples, and after the last pass writes the means into the caller's images.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "lib/pixels.glsl"

layout(local_size_x_id = 0) in;
layout(push_constant, scalar) uniform Push { AccumulatePush push; };

float pass_sum(uint radiance_plane, uint local_pixel) {
  uint word = (state_radiance(push.channels) + radiance_plane) * push.range.capacity + local_pixel * push.range.sample_count;
  float sum = 0.0;
  for (uint s = 0u; s < push.range.sample_count; ++s) sum += push.state.at[word + s];
  return sum;
}

void write_output(uint kind, Pixel pixel, uint channel, float value) {
  OutputRecord record = push.outputs.at[kind];
  if (record.enabled != 0u) record.words.at[output_word(record, pixel, push.channels) + channel] = floatBitsToUint(value);
}

void main() {
  uint local_pixel = gl_GlobalInvocationID.x;
  if (local_pixel >= push.range.pixel_count) return;
  Pixel pixel = wave_pixel(push.range, local_pixel);
  for (uint c = 0u; c < push.channels; ++c) {
    float radiance = 0.0;
    for (uint group = 0u; group < group_count; ++group) {
      uint radiance_plane = group * push.channels + c, word = radiance_plane * push.range.pixel_count + local_pixel;
      float sum = pass_sum(radiance_plane, local_pixel);
      if (push.first_pass == 0u) sum += push.sums.at[word];
      if (push.last_pass == 0u) push.sums.at[word] = sum;
      sum *= push.inverse_samples;
      radiance += sum;
      if (push.last_pass != 0u) write_output(output_radiance + 1u + group, pixel, c, sum);
    }
    if (push.last_pass != 0u) write_output(output_radiance, pixel, c, radiance);
  }
}
