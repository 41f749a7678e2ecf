// SPDX-License-Identifier: Apache-2.0
// Stage `srgb`: one pixel of held radiance in bytes, under the caller's exposure or one that the median lit pixel's green chooses.
bool is_light(uint bits) { return bits >= light_smallest && bits < light_infinite; }

void count_light(uint i) {
  uint columns = (push.width + light_stride - 1u) / light_stride, rows = (push.height + light_stride - 1u) / light_stride;
  uint column = i % columns * light_stride, line = i / columns;
  uint row = line / rows * push.height + line % rows * light_stride;
  uint bits = push.from.at[(row * push.width + column) * 3u + 1u];
  if (!is_light(bits)) return;
  uint light_class = bits >> light_class_shift;
  atomicAdd(push.lights.at[lights_decades + (light_class >> light_decade_shift)], 1u);
  atomicAdd(push.lights.at[lights_classes + light_class], 1u);
}

/// The middle one of all that were counted, the lower one of two.
void choose_exposure() {
  uint lit = 0u;
  for (uint d = 0u; d < light_decades; ++d) lit += push.lights.at[lights_decades + d];
  float chosen = 1.0f;
  if (lit > 0u) {
    uint before = (lit - 1u) / 2u, place = lights_decades;
    for (; before >= push.lights.at[place]; ++place) before -= push.lights.at[place];
    place = lights_classes + ((place - lights_decades) << light_decade_shift);
    for (; before >= push.lights.at[place]; ++place) before -= push.lights.at[place];
    chosen = push.exposures.at[place - lights_classes];
  }
  push.lights.at[lights_exposure] = floatBitsToUint(chosen);
}

/// Negative light and NaN become 0.
uint srgb_byte(uint bits, float exposure) {
  if (bits < light_smallest || bits > light_infinite) return 0u;
  bits = floatBitsToUint(min(uintBitsToFloat(bits) * exposure, 1.0f));
  if (bits >> 16u < srgb_first_entry) return 0u;
  uint entry = push.curve.at[(bits >> 16u) - srgb_first_entry];
  return (entry >> srgb_byte_shift) + ((bits & 0xffffu) >= (entry & srgb_start_mask) ? 1u : 0u);
}

void encode_pixel(uint i) {
  float exposure = push.exposure > 0.0f ? push.exposure : uintBitsToFloat(push.lights.at[lights_exposure]);
  uint row = i / push.width;
  uint element = output_element(push.to, Pixel(row / push.height, row % push.height, i % push.width), 4u);
  uint red = srgb_byte(push.from.at[i * 3u], exposure), green = srgb_byte(push.from.at[i * 3u + 1u], exposure),
       blue = srgb_byte(push.from.at[i * 3u + 2u], exposure);
  push.to.words.at[element / 4u] = red | green << 8u | blue << 16u | 0xff000000u;
}

void srgb(uint i) {
  if (push.step == srgb_count) count_light(i);
  else if (push.step == srgb_choose) choose_exposure();
  else encode_pixel(i);
}
