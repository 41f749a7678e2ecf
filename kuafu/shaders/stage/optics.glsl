// SPDX-License-Identifier: Apache-2.0
// Stage `optics`: what the camera's optics do to linear light, one step per launch, one element of it per invocation.
uint pixels_per_view() { return push.width * push.height; }
float field(uint position, uint length) { return length > 1u ? 2.0f * float(position) / float(length - 1u) - 1.0f : 0.0f; }

/// (fx^2 + fy^2) / 2.
float field_square(uint column, uint row) {
  float x = field(column, push.width), y = field(row, push.height);
  return 0.5f * (x * x + y * y);
}

void copy_pixel(uint pixel) {
  for (uint c = 0u; c < push.channels; ++c) push.to.at[pixel * push.channels + c] = push.from.at[pixel * push.channels + c];
}

/// The image goes on beyond its border as in a mirror, whose plane is the border's pixel.
int mirrored(int position, int last) {
  int inside = abs(position);
  return clamp(inside > last ? 2 * last - inside : inside, 0, last);
}

/// Light of `from` that did not come straight from the projector; the second step finds it by itself.
float indirect(uint word) {
  float light = push.from.at[word];
  return step == optics_fireflies ? max(light - push.direct.at[word], 0.0f) : light;
}

void fireflies(uint pixel, int reach) {
  float factor = push.optics.at[pixel / pixels_per_view()].firefly_factor;
  if (factor == 0.0f) {
    copy_pixel(pixel);
    return;
  }
  int column = int(pixel % push.width), row = int(pixel / push.width % push.height), first_row = int(pixel / push.width) - row;
  int last_column = int(push.width) - 1, last_row = int(push.height) - 1;
  for (uint c = 0u; c < push.channels; ++c) {
    float brightest = 0.0f;
    for (int y = row - reach; y <= row + reach; y += reach)
      for (int x = column - reach; x <= column + reach; x += reach) {
        uint other = uint((first_row + mirrored(y, last_row)) * int(push.width) + mirrored(x, last_column));
        if (x != column || y != row) brightest = max(brightest, indirect(other * push.channels + c));
      }
    uint word = pixel * push.channels + c;
    float light = indirect(word);
    if (light > factor * brightest) light = brightest;
    push.to.at[word] = step == optics_fireflies ? light : light + push.direct.at[word];
  }
}

/// 1 / sqrt(square)^exponent; a lens' usual exponents go without a call.
float power_of_cosine(float square, float exponent) {
  float cosine = inversesqrt(square);
  if (exponent == 3.0f) return cosine * cosine * cosine;
  if (exponent == 4.0f) return cosine * cosine * cosine * cosine;
  return pow(square, -0.5f * exponent);
}

/// Where a pixel would look at z = 1 if the lens bent nothing.
vec2 straight_ray(IN(OpticsRecord) f, uint column, uint row) {
  float y = (float(row) - f.cy) / f.fy;
  return vec2((float(column) - f.cx - f.skew * y) / f.fx, y);
}

float vignetting_along(IN(OpticsRecord) f, vec2 p, uint column, uint row) {
  float r2 = field_square(column, row);
  vec3 a = f.vignetting_polynomial;
  float factor = max(0.0f, 1.0f + r2 * (a.x + r2 * (a.y + r2 * a.z)));
  return factor * power_of_cosine(1.0f + dot(p, p), f.vignetting_exponent);
}

float vignetting_factor(IN(OpticsRecord) f, uint column, uint row) {
  return vignetting_along(f, undistort(f.lens, straight_ray(f, column, row)), column, row);
}

void vignetting(uint pixel) {
  float factor = vignetting_factor(push.optics.at[pixel / pixels_per_view()], pixel % push.width, pixel / push.width % push.height);
  for (uint c = 0u; c < push.channels; ++c) push.to.at[pixel * push.channels + c] *= factor;
}

float inverse_depth(uint pixel) {
  float z = push.depth.at[pixel];
  return z > 0.0f ? 1.0f / z : 0.0f;  // nothing hit is infinitely far
}

/// Radius in pixels of the circle that a point at this depth becomes; half a pixel is a point.
float circle_radius(IN(OpticsRecord) f, float inverse_z) {
  return clamp(f.defocus_px_m * abs(inverse_z - f.defocus_inverse_focus), 0.5f, float(optics_most_radius_px));
}

void circle_row(uint row) {
  IN(OpticsRecord) f = push.optics.at[row / push.height];
  float most = 0.5f;
  for (uint column = 0u; column < push.width; ++column) most = max(most, circle_radius(f, inverse_depth(row * push.width + column)));
  push.rows.at[row] = most;
}

/// Share of its light that a circle brings to the pixel at this distance; its rim is one pixel wide, and pi (r^2 + 1/12) its whole.
float circle_share(float radius, float distance) {
  return clamp(radius + 0.5f - distance, 0.0f, 1.0f) / (3.14159265f * (radius * radius + 1.0f / 12.0f));
}

// Light is spread from its own circle. What lies behind a pixel's surface spreads no farther over it than that surface blurs itself, so a sharp edge
// stays sharp before a blurred background; what lies before it spreads over it. Dividing by the sum of shares fills in for what is hidden.
void defocus(uint pixel) {
  IN(OpticsRecord) f = push.optics.at[pixel / pixels_per_view()];
  if (f.defocus_px_m == 0.0f) {
    copy_pixel(pixel);
    return;
  }
  int column = int(pixel % push.width), row = int(pixel / push.width % push.height), first_row = int(pixel / push.width) - row;
  float here = inverse_depth(pixel), own = circle_radius(f, here);
  float sum[3], shares = 0.0f;
  for (uint c = 0u; c < 3u; ++c) sum[c] = 0.0f;
  int reach = int(optics_most_radius_px);
  for (int y = max(row - reach, 0); y <= min(row + reach, int(push.height) - 1); ++y) {
    float rise = float(y - row), most = push.rows.at[first_row + y] + 0.5f;
    if (abs(rise) >= most) continue;
    int side = int(sqrt(most * most - rise * rise));
    for (int x = max(column - side, 0); x <= min(column + side, int(push.width) - 1); ++x) {
      uint other = uint((first_row + y) * int(push.width) + x);
      float there = inverse_depth(other), radius = circle_radius(f, there);
      if (there < here) radius = min(radius, own);
      float run = float(x - column), share = circle_share(radius, sqrt(run * run + rise * rise));
      shares += share;
      for (uint c = 0u; c < push.channels; ++c) sum[c] += share * push.from.at[other * push.channels + c];
    }
  }
  for (uint c = 0u; c < push.channels; ++c) push.to.at[pixel * push.channels + c] = sum[c] / shares;
}

/// Between two kernels of the table: their mixture has exactly the variance in between.
float psf_weight(IN(OpticsRecord) f, uint column, uint row, uint distance) {
  uint word = f.psf_kernels + distance, stride = f.psf_radius + 1u;
  if (f.psf_kernels_per_variance == 0.0f) return push.kernels.at[word];
  float corner = f.psf_corner_sigma_px * field_square(column, row);
  float k = corner * corner * f.psf_kernels_per_variance;
  word += uint(k) * stride;
  float nearer = push.kernels.at[word];
  return nearer + (k - floor(k)) * (push.kernels.at[word + stride] - nearer);
}

// Each source pixel spreads by its own kernel, whose sum is 1, so energy stays. Beyond the border the light is that of the border's pixel.
void psf(uint pixel, bool along_row) {
  IN(OpticsRecord) f = push.optics.at[pixel / pixels_per_view()];
  int column = int(pixel % push.width), row = int(pixel / push.width % push.height), first_row = int(pixel / push.width) - row;
  int last_column = int(push.width) - 1, last_row = int(push.height) - 1, radius = int(f.psf_radius);
  float sum[3];
  for (uint c = 0u; c < 3u; ++c) sum[c] = 0.0f;
  for (int k = -radius; k <= radius; ++k) {
    int x = along_row ? clamp(column + k, 0, last_column) : column, y = along_row ? row : clamp(row + k, 0, last_row);
    float weight = psf_weight(f, uint(x), uint(y), uint(abs(k)));
    uint word = uint((first_row + y) * int(push.width) + x) * push.channels;
    for (uint c = 0u; c < push.channels; ++c) sum[c] += weight * push.from.at[word + c];
  }
  for (uint c = 0u; c < push.channels; ++c) push.to.at[pixel * push.channels + c] = sum[c];
}

void row_sum(uint i) {
  uint row = i / push.channels, c = i % push.channels;
  float sum = 0.0f;
  for (uint x = 0u; x < push.width; ++x) sum += push.from.at[(row * push.width + x) * push.channels + c];
  push.rows.at[i] = sum;
}

void view_mean(uint i) {
  uint view = i / push.channels, c = i % push.channels;
  float sum = 0.0f;
  for (uint y = 0u; y < push.height; ++y) sum += push.rows.at[(view * push.height + y) * push.channels + c];
  push.rows.at[push.view_count * push.height * push.channels + i] = sum / float(pixels_per_view());
}

void veiling_glare(uint pixel) {
  float fraction = push.optics.at[pixel / pixels_per_view()].veiling_glare_fraction;
  uint mean = (push.view_count * push.height + pixel / pixels_per_view()) * push.channels;
  for (uint c = 0u; c < push.channels; ++c) {
    uint word = pixel * push.channels + c;
    push.to.at[word] = (1.0f - fraction) * push.to.at[word] + fraction * push.rows.at[mean + c];
  }
}

void optics(uint i) {
  if (step == optics_vignetting) vignetting(i);
  if (step == optics_circle_rows) circle_row(i);
  if (step == optics_defocus) defocus(i);
  if (step == optics_psf_columns) psf(i, true);
  if (step == optics_psf_rows) psf(i, false);
  if (step == optics_row_sums) row_sum(i);
  if (step == optics_view_means) view_mean(i);
  if (step == optics_veiling_glare) veiling_glare(i);
  if (step == optics_fireflies) fireflies(i, 1);
  if (step == optics_firefly_pairs) fireflies(i, 2);
}
