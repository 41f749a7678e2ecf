// SPDX-License-Identifier: Apache-2.0
// Stage `remodulate`: the filter works on one surface per pixel, an image has the mean over the pixel's square. So rays over the square ask what is there,
// each takes the filtered light of the nearest pixels of its surface, and its own albedo: edges and textures become as smooth as there are rays.
// Where all around is of one surface and colour, a pixel needs none (square_of).
const float least_own_share = 1e-6f;  // weight of a pixel for its own rays, where they meet what no neighbour shows

struct Gathered {
  float light[most_planes];
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
      GuideRecord there = load_surface(push.guides, other);
      vec3 away = there.position - g.position;
      float pixels = g.material == miss ? float(dx * dx + dy * dy) : length(away) / (g.footprint_m + least_length_m);
      bool own = dx == 0 && dy == 0;
      float weight = falling(surface_unlike(g, there, square_reach_px, any_exponent)) * falling(square_reach_px * pixels) + (own ? least_own_share : 0.0f);
      out_.weights += weight;
      for (uint p = 0u; p < planes; ++p) out_.light[p] += weight * push.light.at[other * planes + p];
    }
  return out_;
}

/// How many pixels of the list the wave has.
uint square_count() {
  uint listed = push.squares_or_blended.at[0];
  return min(push.range.pixel_count, listed - min(listed, push.range.first_pixel));
}

uint square_pixel(uint local_pixel) { return push.squares_or_blended.at[1u + push.range.first_pixel + local_pixel]; }

/// A ray's share of its pixel.
Gathered square_light(uint ray) {
  Pixel pixel = image_pixel(push.range, square_pixel(ray / square_rays));
  GuideRecord g = guide_of_ray(ray, pixel.view);
  uint planes = plane_count(), channels = push.images.at[0].channels;
  Gathered near = gather(g, pixel, planes);
  for (uint p = 0u; p < planes; ++p) near.light[p] *= g.albedo[int(p % channels)] / (near.weights * float(square_rays));
  return near;
}

/// On edges, more samples than rays know the square better than the rays do.
void remodulate(uint pixel, uint plane, float light) {
  DenoiseImages images = push.images.at[0];
  float rays = float(square_rays), samples = float(push.samples);
  float trust = push.pixels.at[pixel].square == square_edge && samples > rays ? rays / (rays + samples) : 1.0f;
  float own = images.denoised[plane / images.channels].at[pixel * images.channels + plane % images.channels];
  push.light_out.at[pixel * plane_count() + plane] = own + trust * (light - own);
}
