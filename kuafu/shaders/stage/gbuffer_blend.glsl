// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`, the last steps: pixels that show two surfaces, and the means of an imager's pixels. And all steps.
const float edge_px = 0.2f;           // of what a pixel spans there: what lies so far off a surface's plane is another surface

/// Whether a pixel's neighbours along its row or its column lie off a plane with it.
bool is_bent(FloatArray inverse_depth, uint pixel, int stride, float inverse, float most) {
  return abs(inverse_depth.at[int(pixel) - stride] + inverse_depth.at[int(pixel) + stride] - 2.0f * inverse) > most;
}

/// The room's light over a pixel's square, which an edge crosses where three or more of its eight neighbours show another surface: of random
/// straight edges, 0.2 of the square is theirs with three neighbours and 0.4 with four.
void blend_pixel(uint i, IN(GbufferPlace) p) {
  IN(GbufferCamera) camera = push.record.at[0].cameras[p.camera];
  float inverse = camera.inverse_depth.at[p.pixel], room = push.record.at[0].room.at[i], most = edge_px * inverse / push.record.at[0].focal_px;
  int width = int(push.record.at[0].width);
  bool is_inside = p.row > 0u && p.column > 0u && p.row + 1u < push.record.at[0].height && p.column + 1u < push.record.at[0].width;
  if (is_inside && (is_bent(camera.inverse_depth, p.pixel, 1, inverse, most) || is_bent(camera.inverse_depth, p.pixel, width, inverse, most))) {
    GbufferSurface s = surface_at_pixel(p);
    float towards = dot(s.normal, s.way), cosine = dot(s.normal, s.to_camera);
    float others = 0.0f, sum = 0.0f, weights = 0.0f;
    for (int k = 0; k < 9; ++k) {
      int x = k % 3 - 1, y = k / 3 - 1, aside = y * width + x;
      float there = camera.inverse_depth.at[int(p.pixel) + aside];
      vec3 way = pixel_way(camera.view, float(int(p.column) + x), float(int(p.row) + y));
      float plane = inverse * dot(s.normal, way) / min(towards, -1e-6f);
      if (abs(there - plane) * cosine * cosine <= most) continue;
      float weight = x == 0 || y == 0 ? 1.0f : 0.25f;
      others += 1.0f;
      sum += weight * push.record.at[0].room.at[int(i) + aside];
      weights += weight;
    }
    if (others > 2.0f) room = mix(room, sum / weights, 0.2f * min(others - 2.0f, 2.0f));
  }
  write_output(output_radiance, p, room + push.record.at[0].laser.at[i]);
}

/// A pixel of an imager gets the mean of its samples; its depth is that of one in the middle.
void average_pixel(uint i) {
  uint n = push.record.at[0].supersampling, columns = push.record.at[0].width / n, rows = push.record.at[0].height / n;
  Pixel p = Pixel(i / columns / rows, i / columns % rows, i % columns);
  for (uint kind = 0u; kind < output_kind_count; ++kind) {
    IN(OutputRecord) samples = push.record.at[0].outputs.at[kind];
    IN(OutputRecord) pixels = push.record.at[0].averaged.at[kind];
    if (samples.enabled == 0u) continue;
    bool is_depth = kind == output_depth;
    uint first = is_depth ? n / 2u : 0u, side = is_depth ? 1u : n;
    float sum = 0.0f;
    for (uint k = 0u; k < side * side; ++k) {
      Pixel sample_pixel = Pixel(p.view, p.row * n + first + k / side, p.column * n + first + k % side);
      sum += uintBitsToFloat(samples.words.at[output_element(samples, sample_pixel, 1u)]);
    }
    pixels.words.at[output_element(pixels, p, 1u)] = floatBitsToUint(sum / float(side * side));
  }
}

void gbuffer_step(uint i) {
  if (step == gbuffer_read) read_pixel(i);
  else if (step == gbuffer_between) mark_between(i);
  else if (step == gbuffer_middles) mark_middle(i);
  else if (step == gbuffer_warp) warp_pixel(i);
  else if (step == gbuffer_light) light_pixel(i);
  else if (step == gbuffer_cells) mean_of_cell(i);
  else if (step == gbuffer_sky) look_around(i);
  else if (step == gbuffer_smooth) smooth_cell(i);
  else if (step == gbuffer_blend) blend_pixel(i, gbuffer_place(i));
  else average_pixel(i);
}
