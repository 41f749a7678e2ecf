// Stage `remodulate`: the filter works on one surface per pixel, an image has the mean over the pixel's square. So rays over the square ask what is there,
// each takes the filtered light of the nearest pixels of its surface, and its own albedo: edges and textures become as smooth as there are rays.
const uint most_planes = 15u;

struct Gathered {
  float light[15];
  float weights;
};

/// Light over albedo where the ray met surface `g`, from the 3 x 3 pixels around.
Gathered gather(GuideRecord g, Pixel pixel, uint planes) {
  Gathered out_;
  out_.weights = 0.0f;
  for (uint p = 0u; p < most_planes; ++p) out_.light[p] = 0.0f;
  uint width = push.range.width, height = push.range.height;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      int x = int(pixel.column) + dx, y = int(pixel.row) + dy;
      if (x < 0 || y < 0 || x >= int(width) || y >= int(height)) continue;
      uint other = (pixel.view * height + uint(y)) * width + uint(x);
      GuideRecord there = push.guides.at[other];
      vec3 away = there.position - g.position;
      float pixels = g.material == miss ? float(dx * dx + dy * dy) : length(away) / (g.footprint_m + 1e-9f);
      bool own = dx == 0 && dy == 0;
      float weight = falling(surface_unlike(g, there, 2.0f, 1e9f)) * falling(2.0f * pixels) + (own ? 1e-6f : 0.0f);
      out_.weights += weight;
      for (uint p = 0u; p < planes; ++p) out_.light[p] += weight * push.light.at[other * planes + p];
    }
  return out_;
}

void remodulate(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  DenoiseImages images = push.images.at[0];
  uint planes = images.denoised_count * images.channels, i = (pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column;
  float sum[15];
  for (uint p = 0u; p < planes; ++p) sum[p] = 0.0f;
  float share = 1.0f / float(push.range.sample_count);
  for (uint s = 0u; s < push.range.sample_count; ++s) {
    GuideRecord g = guide_of_ray(local_pixel * push.range.sample_count + s, pixel.view);
    Gathered near = gather(g, pixel, planes);
    for (uint p = 0u; p < planes; ++p) sum[p] += share * g.albedo[int(p % images.channels)] * near.light[p] / near.weights;
  }
  // On edges, more samples than rays know the square better than the rays do.
  float rays = float(push.range.sample_count), samples = float(push.samples);
  float trust = push.pixels.at[i * denoise_words + denoise_inside] < 1.0f && samples > rays ? rays / (rays + samples) : 1.0f;
  for (uint p = 0u; p < planes; ++p) {
    uint k = p / images.channels, word = i * images.channels + p % images.channels;
    images.denoised[k].at[word] += trust * (sum[p] - images.denoised[k].at[word]);
  }
}
