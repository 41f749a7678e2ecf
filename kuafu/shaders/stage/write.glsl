// SPDX-License-Identifier: Apache-2.0
// Stage `write`: one pixel of a held image in the caller's format and layout. Ids that do not fit were refused; "none" keeps all bits set.
void write_pixel(uint i) {
  uint row = i / push.width;
  uint element = output_element(push.to, Pixel(row / push.height, row % push.height, i % push.width), push.channels);
  for (uint c = 0u; c < push.channels; ++c) {
    uint value = push.from.at[i * push.channels + c];
    float light = uintBitsToFloat(value);
    if (push.sums != 0u) light += push.second.at[i * push.channels + c];
    if (push.integer == 0u) value = element_of_float(light * push.to.scale, push.to.format);
    store_element(push.to.words, element + c, push.to.format, value);
  }
}
