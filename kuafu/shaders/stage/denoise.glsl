// SPDX-License-Identifier: Apache-2.0
// Stage `denoise`: an edge-stopping a-trous filter on all images but the projectors' direct light, with one set of weights, so that the sum of the images is
// filtered as they are. Light is filtered over albedo; noise is known from the pixel's own samples.
// Sources: the filter, its taps and its stopping at normals and positions are of Dammertz, Sewtz, Hanika and Lensch, Edge-Avoiding A-Trous Wavelet Transform,
// HPG 2010; that the variance of the samples scales how far levels may differ is of Schied et al., Spatiotemporal Variance-Guided Filtering, HPG 2017
// (section 4.4). Numbers without a source are tuned: tests/bench/bench_denoise.py has the errors of four scenes to change them by.

// Levels are compared in standard deviations of their noise. Schied 2017 lets pixels themselves mix up to 4; here means of 3 x 3 of them are compared, which
// have about a third of the noise.
const float level_reach = 2.0f;
// A pixel may stand out from its neighbours by so many standard deviations of their scatter: 3, the usual bound for an outlier of a normal distribution.
const float speckle_reach = 3.0f;
// Light of the last launches may lie so many standard deviations off this launch's means: 2 hold 95 % of a normal distribution.
const float change_reach = 2.0f;
const float edge_confidence = 0.1f;                      // of a pixel on an edge: its samples may be of the other surface
const float most_apart = 0.5f, most_recoloured = 0.02f;  // of neighbours whose pixel one ray tells of: surface_unlike, and share of the albedo
const float edge_apart = 1.2f, edge_recoloured = 0.1f;   // from here on there is an edge between them
const float edge_exponent = 8.0f;                        // of normals: curved surfaces have no edges
const float blurred_exponent = matt_exponent;            // of normals where statistics, not light, are averaged: mirrors are as wide as matt surfaces

const float relative_reach = 1e-3f, least_reach = 1e-12f;  // of levels, where the noise is known to be nothing
const float own_least = 1e-4f;                             // weight of a pixel without any like it: it keeps its light
const int worth_reach = 2;       // pixels around that tell what filtering is worth
const float few_samples = 8.0f;  // over their number: what is added to the scatter of so few that they tell little of it
const float full_support = 0.5f;                           // of the kernel on this surface: a pixel there is as sure as its neighbours

/// The pixel (dx, dy) away, or `miss` where the view ends.
uint neighbour(uint pixel, int dx, int dy) {
  int x = int(pixel % push.width) + dx, y = int(pixel / push.width % push.height) + dy;
  if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) return miss;
  return uint(int(pixel) + dy * int(push.width) + dx);
}

float confidence_of(uint square) { return square == square_edge ? edge_confidence : 1.0f; }

/// Where a neighbour is of another surface or colour, this pixel's square may be, too.
uint square_of(uint pixel) {
  GuideRecord here = load_guide(push.guides, pixel);
  uint square = square_plain;
  if (here.material == mixed_materials) return square;
  float brightest = max(here.albedo.x, max(here.albedo.y, here.albedo.z));
  for (int i = 0; i < 9; ++i) {
    int dx = i % 3 - 1, dy = i / 3 - 1;
    uint other = neighbour(pixel, dx, dy);
    if (other == miss || other == pixel) continue;
    GuideRecord there = load_guide(push.guides, other);
    vec3 turn = abs(there.albedo - here.albedo);
    float apart = surface_unlike(here, there, 1.0f, edge_exponent), recoloured = max(turn.x, max(turn.y, turn.z)) / brightest;
    if ((dx == 0 || dy == 0) && (apart > edge_apart || recoloured > edge_recoloured)) return square_edge;
    if (surface_unlike(here, there, 1.0f, any_exponent) > most_apart || recoloured > most_recoloured) square = square_varied;
  }
  return square;
}

/// Of the pixel's samples, from their blocks' own scatter.
float variance_of_mean(uint pixel, OUT(float) mean) {
  uint word = pixel * moment_words;
  float n = float(push.samples), first = push.moments.at[word], blocks = push.moments.at[word + 2u];
  mean = first / n;
  return blocks > 1.0f ? max(0.0f, push.moments.at[word + 1u] - first * mean) / (n * (blocks - 1.0f)) : 0.0f;
}

void divide(uint pixel) {
  vec3 albedo = load_guide(push.guides, pixel).albedo;
  uint channels = push.images.at[0].channels;
  float level = 0.0f;
  for (uint k = 0u; k < push.images.at[0].denoised_count; ++k)
    for (uint c = 0u; c < channels; ++c) {
      float light = push.images.at[0].denoised[k].at[pixel * channels + c] / albedo[int(c)];
      push.light_out.at[pixel * plane_count() + k * channels + c] = light;
      level += light / float(channels);
    }
  float mean, variance = variance_of_mean(pixel, mean), scale = mean > 0.0f ? level / mean : 0.0f;  // scaled as the light is
  uint square = square_of(pixel);
  push.pixels_out.at[pixel] = PixelStatistics(level, variance * scale * scale, confidence_of(square), square);
}

// Takes down what stands out from 5 x 5 like neighbours and whose own noise explains it. Their weights fall with how unlike their surfaces are (lib/alike.glsl) and,
// for levels, by their confidence. Variances are averaged with the same weights, mirror or not: two samples tell little of their own. One sample tells
// nothing, and the neighbours' scatter stands in for it.
void despeckle(uint pixel) {
  GuideRecord here = load_guide(push.guides, pixel);
  PixelStatistics own = push.pixels_in.at[pixel];
  float own_variance = own.variance, level = own.level;
  float weights = 0.0f, first = 0.0f, second = 0.0f, variance = own_variance, all = 1.0f;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss || other == pixel) continue;
      float distance = float(max(abs(dx), abs(dy)));
      float weight = falling(surface_unlike(here, load_surface(push.guides, other), distance, blurred_exponent));
      if (weight == 0.0f) continue;
      all += weight;
      PixelStatistics there = push.pixels_in.at[other];
      variance += weight * there.variance;
      weight *= there.confidence;
      weights += weight;
      first += weight * there.level;
      second += weight * there.level * there.level;
    }
  variance /= all;
  float keep = 1.0f;
  if (weights > 1.0f) {  // there is more than one neighbour to compare with
    first /= weights;
    float scatter = max(0.0f, second / weights - first * first);
    if (push.samples == 1u) own_variance = variance = scatter;
    float most = first + speckle_reach * sqrt(scatter);
    // The excess is noise where the pixel's own standard deviation is more than a quarter of it.
    bool explained = push.samples == 1u || own_variance > 0.25f * 0.25f * (level - first) * (level - first);
    if (level > most && level > 0.0f && explained) keep = most / level;
  }
  for (uint p = 0u; p < plane_count(); ++p) {
    uint word = pixel * plane_count() + p;
    push.light_out.at[word] = push.light_in.at[word] * keep;
  }
  push.pixels_out.at[pixel] = PixelStatistics(level * keep, variance, confidence_of(own.square), own.square);
}

// Pixels are told apart by the means of 3 x 3 alike around them, which have about a third of the noise (0.375): a highlight's slope stands out from it earlier. The
// weights are the binomial ones, 1 2 1 across and down.
void smooth_levels(uint pixel) {
  GuideRecord here = load_guide(push.guides, pixel);
  int spacing = int(push.spacing);
  float level = 0.0f, weights = 0.0f, variance = 0.0f;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      uint other = neighbour(pixel, dx * spacing, dy * spacing);
      if (other == miss) continue;
      float t = other == pixel ? 0.0f : surface_unlike(here, load_surface(push.guides, other), float(spacing), any_exponent);
      PixelStatistics there = push.pixels_in.at[other];
      float weight = (dx == 0 ? 1.0f : 0.5f) * (dy == 0 ? 1.0f : 0.5f) * falling(t) * there.confidence;
      weights += weight;
      level += weight * there.level;
      variance += weight * weight * there.variance;
    }
  PixelStatistics own = push.pixels_in.at[pixel];
  push.smoothed.at[pixel] = SmoothStatistics(level / weights, variance / (weights * weights), own.variance, own.confidence);
}

/// The least and the most that light here may be, by what this launch shows around it: where a shadow has gone, history must not keep it.
vec2 plausible_levels(uint pixel) {
  GuideRecord here = load_guide(push.guides, pixel);
  float least = 1e30f, most = 0.0f;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss || (other != pixel && surface_unlike(here, load_surface(push.guides, other), 1.0f, blurred_exponent) > 1.0f)) continue;
      SmoothStatistics there = push.smoothed.at[other];
      float reach = change_reach * sqrt(there.variance);
      least = min(least, there.level - reach);
      most = max(most, there.level + reach);
    }
  return vec2(least, most);
}

// Light of the last launches at this surface's place then, where that showed the same surface of the same instance: disocclusion starts again. The four pixels
// around that place have bilinear weights, times what falls with how unlike their surfaces are.
void accumulate(uint pixel) {
  DenoiseImages images = push.images.at[0];
  uint planes = plane_count(), view = pixel / (push.width * push.height);
  GuideRecord here = load_guide(push.guides, pixel);
  PlaceRecord place = images.places.at[pixel];
  here.position = place.position;
  here.normal = place.normal;
  float sum[most_planes], weights = 0.0f, variance = 0.0f, launches = 0.0f;
  for (uint p = 0u; p < most_planes; ++p) sum[p] = 0.0f;
  if (images.has_last != 0u) {
    vec2 corner = floor(place.image_point);
    for (int k = 0; k < 4; ++k) {
      int x = int(corner.x) + k % 2, y = int(corner.y) + k / 2;
      if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) continue;
      uint other = (view * push.height + uint(y)) * push.width + uint(x);
      if (images.last_places.at[other].instance != place.instance) continue;
      float weight = max(0.0f, 1.0f - abs(place.image_point.x - float(x))) * max(0.0f, 1.0f - abs(place.image_point.y - float(y)));
      weight *= falling(surface_unlike(here, load_surface(images.last_guides, other), 1.0f, any_exponent));
      weights += weight;
      variance += weight * images.last_pixels.at[other * history_words + history_variance];
      launches += weight * images.last_pixels.at[other * history_words + history_launches];
      for (uint p = 0u; p < planes; ++p) sum[p] += weight * images.last_light.at[other * planes + p];
    }
  }
  bool known = weights > 0.05f;  // else hardly any of the four showed this surface, and their mean would be noise
  launches = known ? launches / weights + 1.0f : 1.0f;
  if (known) {
    float before = 0.0f;
    for (uint p = 0u; p < planes; ++p) before += sum[p] / (weights * float(images.channels));
    vec2 levels = plausible_levels(pixel);
    float plausible = clamp(before, levels.x, levels.y);
    if (plausible != before) {
      launches = 0.5f * launches + 0.5f;  // light changed: half of the history is forgotten, but never this launch
      for (uint p = 0u; p < planes; ++p) sum[p] = before > 0.0f ? sum[p] * plausible / before : push.light_in.at[pixel * planes + p] * weights;
    }
  }
  float share = known ? max(1.0f - images.temporal_weight, 1.0f / launches) : 1.0f, level = 0.0f;
  for (uint p = 0u; p < planes; ++p) {
    float light = push.light_in.at[pixel * planes + p];
    if (known) light = mix(sum[p] / weights, light, share);
    push.light_out.at[pixel * planes + p] = light;
    images.next_light.at[pixel * planes + p] = light;
    level += light / float(images.channels);
  }
  float own = push.pixels_in.at[pixel].variance, rest = 1.0f - share;
  if (known) own = share * share * own + rest * rest * variance / weights;
  images.next_pixels.at[pixel * history_words + history_variance] = own;
  images.next_pixels.at[pixel * history_words + history_launches] = launches;
  uint square = push.pixels_in.at[pixel].square;
  push.pixels_out.at[pixel] = PixelStatistics(level, own, confidence_of(square), square);
}

/// Taps of the cubic B-spline, 1 4 6 4 1 over 16, as Dammertz 2010 takes them.
float binomial(int i) { return i == 0 ? 0.375f : abs(i) == 1 ? 0.25f : 0.0625f; }

/// Binomial mean over 3 x 3 pixels (Schied 2017, section 4.4): a variance that is too low at one pixel must not keep it from mixing.
float smooth_variance(uint pixel) {
  float sum = 0.0f, weights = 0.0f;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss) continue;
      float weight = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
      sum += weight * push.smoothed.at[other].variance;
      weights += weight;
    }
  return sum / weights;
}

// A neighbour's weight is that of its tap, times what falls with how unlike its surface is, with how far its level is off in standard deviations of the noise
// (the larger of the two pixels'), and with its confidence. `support` is the weight that levels had no part in: where much of the kernel is of this surface,
// a pixel on an edge becomes as trustworthy as its neighbours.
void atrous(uint pixel) {
  GuideRecord here = load_guide(push.guides, pixel);
  SmoothStatistics own = push.smoothed.at[pixel];
  float noise_here = smooth_variance(pixel);
  float sum[most_planes], weights = 0.0f, variance = 0.0f, support = 0.0f;
  uint planes = plane_count();
  for (uint p = 0u; p < most_planes; ++p) sum[p] = 0.0f;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx) {
      uint other = neighbour(pixel, dx * int(push.spacing), dy * int(push.spacing));
      if (other == miss) continue;
      float t = other == pixel ? 0.0f : surface_unlike(here, load_surface(push.guides, other), float(max(abs(dx), abs(dy))) * float(push.spacing), any_exponent);
      if (t >= unlike) continue;
      SmoothStatistics there = push.smoothed.at[other];
      float kernel = binomial(dx) * binomial(dy), noise = max(noise_here, there.variance);
      support += kernel * falling(t) * there.confidence;
      t += abs(there.level - own.level) * own.confidence / (level_reach * sqrt(noise) + relative_reach * abs(own.level) + least_reach);
      float weight = kernel * falling(t) * there.confidence;
      if (other == pixel) weight = max(weight, own_least);
      weights += weight;
      variance += weight * weight * there.pixel_variance;
      for (uint p = 0u; p < planes; ++p) sum[p] += weight * push.light_in.at[other * planes + p];
    }
  float mean = 0.0f;
  for (uint p = 0u; p < planes; ++p) {
    sum[p] /= weights;
    push.light_out.at[pixel * planes + p] = sum[p];
    mean += sum[p] / float(push.images.at[0].channels);
  }
  push.pixels_out.at[pixel] = PixelStatistics(mean, variance / (weights * weights), max(own.confidence, min(1.0f, support / full_support)),
                                              push.pixels_in.at[pixel].square);
}

// What rays over the square would make of it where its surroundings are alike, so that they meet one colour: side_weight and corner_weight are the mean shares,
// over all points of the square, that gather() of stage/remodulate.glsl gives a neighbour beside the pixel and across its corner, relative to the pixel's own
// (0.249 and 0.087 by integration of falling(2 * distance), 0.427 being the pixel's own share).
const float side_weight = 0.25f, corner_weight = 0.0875f;
void multiply(uint pixel) {
  bool squares = push.lists != 0u;
  if (squares && push.pixels_in.at[pixel].square != square_plain) return;
  uint channels = push.images.at[0].channels;
  GuideRecord here = load_guide(push.guides, pixel);
  float sum[most_planes], weights = 0.0f;
  uint planes = plane_count();
  for (uint p = 0u; p < most_planes; ++p) sum[p] = 0.0f;
  int reach = squares ? 1 : 0;
  for (int dy = -reach; dy <= reach; ++dy)
    for (int dx = -reach; dx <= reach; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss) continue;
      float weight = other == pixel ? 1.0f : (dx == 0 || dy == 0 ? side_weight : corner_weight) * falling(surface_unlike(here, load_surface(push.guides, other), square_reach_px, any_exponent));
      weights += weight;
      for (uint p = 0u; p < planes; ++p) sum[p] += weight * push.light_in.at[other * planes + p];
    }
  for (uint p = 0u; p < planes; ++p)
    push.light_out.at[pixel * planes + p] = sum[p] / weights * here.albedo[int(p % channels)];
}

/// Share of the filtered light in the pixel; the rest is the mean of its own samples. The square of their difference holds the samples' noise and the filter's
/// bias: around the pixel, what is more than the noise is bias, and each of the two gets the share that the other's square asks for.
float filtered_share(uint pixel) {
  if (push.samples == 1u) return 1.0f;
  float scatter = 0.0f, apart = 0.0f;
  uint planes = plane_count();
  for (int dy = -worth_reach; dy <= worth_reach; ++dy)
    for (int dx = -worth_reach; dx <= worth_reach; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss) continue;
      float mean, filtered = 0.0f;
      scatter += variance_of_mean(other, mean);
      for (uint p = 0u; p < planes; ++p) filtered += push.light_in.at[other * planes + p];
      filtered /= float(push.images.at[0].channels);
      apart += (filtered - mean) * (filtered - mean);
    }
  float expected = scatter * (1.0f + few_samples / float(push.samples - 1u));
  return apart > expected ? scatter / (scatter + apart - expected) : 1.0f;
}

void keep_converged(uint pixel) {
  DenoiseImages images = push.images.at[0];
  float share = filtered_share(pixel);
  uint planes = plane_count();
  for (uint p = 0u; p < planes; ++p) {
    uint word = pixel * images.channels + p % images.channels;
    float own = images.denoised[p / images.channels].at[word];
    images.denoised[p / images.channels].at[word] = own + share * (push.light_in.at[pixel * planes + p] - own);
  }
}

void sum_images(uint pixel) {
  if (push.samples > 0u) keep_converged(pixel);
  DenoiseImages images = push.images.at[0];
  for (uint c = 0u; c < images.channels; ++c) {
    uint word = pixel * images.channels + c;
    float ambient = 0.0f;
    for (uint k = 1u; k < images.denoised_count; ++k) ambient += images.denoised[k].at[word];
    images.ambient.at[word] = ambient;
    images.radiance.at[word] = images.direct.at[word] + images.denoised[0].at[word] + ambient;
  }
}

void denoise(uint pixel) {
  if (denoise_step() == denoise_divide) divide(pixel);
  if (denoise_step() == denoise_despeckle) despeckle(pixel);
  if (denoise_step() == denoise_accumulate) accumulate(pixel);
  if (denoise_step() == denoise_smooth) smooth_levels(pixel);
  if (denoise_step() == denoise_atrous) atrous(pixel);
  if (denoise_step() == denoise_multiply) multiply(pixel);
  if (denoise_step() == denoise_sum) sum_images(pixel);
}
