// Stage `denoise`: an edge-stopping a-trous filter (Dammertz 2010, Schied 2017) on all images but the projectors' direct light, with one set of weights,
// so that the sum of the images is filtered as they are. Light is filtered over albedo; noise is known from the pixel's own samples.
const float level_reach = 2.0f;     // standard deviations between means of pixels that still mix
const float speckle_reach = 3.0f;   // and that a pixel may stand out by from its neighbours, if its noise explains it
const float change_reach = 2.0f;    // and that light of the last launches may be off from means of this one's
const float edge_confidence = 0.1f;

uint plane_count() { return push.images.at[0].denoised_count * push.images.at[0].channels; }
float statistic(uint pixel, uint word) { return push.pixels_in.at[pixel * denoise_words + word]; }
void set_statistics(uint pixel, float level, float variance, float confidence, float inside) {
  push.pixels_out.at[pixel * denoise_words + denoise_level] = level;
  push.pixels_out.at[pixel * denoise_words + denoise_variance] = variance;
  push.pixels_out.at[pixel * denoise_words + denoise_confidence] = confidence;
  push.pixels_out.at[pixel * denoise_words + denoise_inside] = inside;
}

/// The pixel (dx, dy) away, or `miss` where the view ends.
uint neighbour(uint pixel, int dx, int dy) {
  int x = int(pixel % push.width) + dx, y = int(pixel / push.width % push.height) + dy;
  if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) return miss;
  return uint(int(pixel) + dy * int(push.width) + dx);
}

/// Where a neighbour is of another surface or colour, this pixel's square may be, too.
float confidence_of(uint pixel) {
  GuideRecord here = push.guides.at[pixel];
  if (here.material == mixed_materials) return 1.0f;
  for (int i = 0; i < 4; ++i) {
    uint other = neighbour(pixel, i == 0 ? -1 : i == 1 ? 1 : 0, i == 2 ? -1 : i == 3 ? 1 : 0);
    if (other == miss) continue;
    GuideRecord there = push.guides.at[other];
    vec3 turn = abs(there.albedo - here.albedo);
    if (surface_unlike(here, there, 1.0f, 8.0f) > 1.2f || max(turn.x, max(turn.y, turn.z)) > 0.1f * max(here.albedo.x, max(here.albedo.y, here.albedo.z)))
      return edge_confidence;
  }
  return 1.0f;
}

void divide(uint pixel) {
  vec3 albedo = push.guides.at[pixel].albedo;
  uint channels = push.images.at[0].channels;
  float level = 0.0f;
  for (uint k = 0u; k < push.images.at[0].denoised_count; ++k)
    for (uint c = 0u; c < channels; ++c) {
      float light = push.images.at[0].denoised[k].at[pixel * channels + c] / albedo[int(c)];
      push.light_out.at[pixel * plane_count() + k * channels + c] = light;
      level += light / float(channels);
    }
  // Of the mean of the samples, from their own scatter; scaled as the light is.
  float n = float(push.samples), mean = push.moments.at[pixel * 2u] / n;
  float variance = push.samples > 1u ? max(0.0f, push.moments.at[pixel * 2u + 1u] / n - mean * mean) / (n - 1.0f) : 0.0f;
  float scale = mean > 0.0f ? level / mean : 0.0f;
  float inside = confidence_of(pixel);
  set_statistics(pixel, level, variance * scale * scale, inside, inside);
}

// Variances are averaged over like neighbours, mirror or not: two samples tell little of their own. One sample tells nothing: the neighbours' scatter stands in.
void despeckle(uint pixel) {
  GuideRecord here = push.guides.at[pixel];
  float own_variance = statistic(pixel, denoise_variance), level = statistic(pixel, denoise_level);
  float weights = 0.0f, first = 0.0f, second = 0.0f, variance = own_variance, all = 1.0f;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss || other == pixel) continue;
      float distance = float(max(abs(dx), abs(dy)));
      float weight = falling(surface_unlike(here, push.guides.at[other], distance, 32.0f));
      if (weight == 0.0f) continue;
      all += weight;
      variance += weight * statistic(other, denoise_variance);
      weight *= statistic(other, denoise_confidence);
      float there = statistic(other, denoise_level);
      weights += weight;
      first += weight * there;
      second += weight * there * there;
    }
  variance /= all;
  float keep = 1.0f;
  if (weights > 1.0f) {
    first /= weights;
    float scatter = max(0.0f, second / weights - first * first);
    if (push.samples == 1u) own_variance = variance = scatter;
    float most = first + speckle_reach * sqrt(scatter);
    bool explained = push.samples == 1u || own_variance > 0.0625f * (level - first) * (level - first);
    if (level > most && level > 0.0f && explained) keep = most / level;
  }
  for (uint p = 0u; p < plane_count(); ++p) {
    uint word = pixel * plane_count() + p;
    push.light_out.at[word] = push.light_in.at[word] * keep;
  }
  float inside = statistic(pixel, denoise_inside);
  set_statistics(pixel, level * keep, variance, inside, inside);
}

// Pixels are told apart by the means of 3 x 3 alike around them, which have a third of the noise: a highlight's slope stands out from it earlier.
void smooth_levels(uint pixel) {
  GuideRecord here = push.guides.at[pixel];
  int spacing = int(push.spacing);
  float level = 0.0f, weights = 0.0f, variance = 0.0f;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      uint other = neighbour(pixel, dx * spacing, dy * spacing);
      if (other == miss) continue;
      float t = other == pixel ? 0.0f : surface_unlike(here, push.guides.at[other], float(spacing), 1e9f);
      float weight = (dx == 0 ? 1.0f : 0.5f) * (dy == 0 ? 1.0f : 0.5f) * falling(t) * statistic(other, denoise_confidence);
      weights += weight;
      level += weight * statistic(other, denoise_level);
      variance += weight * weight * statistic(other, denoise_variance);
    }
  for (uint word = 0u; word < denoise_smooth_level; ++word) push.pixels_out.at[pixel * denoise_words + word] = statistic(pixel, word);
  push.pixels_out.at[pixel * denoise_words + denoise_smooth_level] = level / weights;
  push.pixels_out.at[pixel * denoise_words + denoise_smooth_variance] = variance / (weights * weights);
}

/// The least and the most that light here may be, by what this launch shows around it: where a shadow has gone, history must not keep it.
vec2 plausible_levels(uint pixel) {
  GuideRecord here = push.guides.at[pixel];
  float least = 1e30f, most = 0.0f;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss || (other != pixel && surface_unlike(here, push.guides.at[other], 1.0f, 32.0f) > 1.0f)) continue;
      float level = statistic(other, denoise_smooth_level), reach = change_reach * sqrt(statistic(other, denoise_smooth_variance));
      least = min(least, level - reach);
      most = max(most, level + reach);
    }
  return vec2(least, most);
}

// Light of the last launches at this surface's place then, where that showed the same surface of the same instance: disocclusion starts anew.
void accumulate(uint pixel) {
  DenoiseImages images = push.images.at[0];
  uint planes = plane_count(), view = pixel / (push.width * push.height);
  GuideRecord here = push.guides.at[pixel];
  PlaceRecord place = images.places.at[pixel];
  here.position = place.position;
  here.normal = place.normal;
  float sum[15], weights = 0.0f, variance = 0.0f, launches = 0.0f;
  for (uint p = 0u; p < 15u; ++p) sum[p] = 0.0f;
  if (images.has_last != 0u) {
    vec2 corner = floor(place.film);
    for (int k = 0; k < 4; ++k) {
      int x = int(corner.x) + k % 2, y = int(corner.y) + k / 2;
      if (x < 0 || y < 0 || x >= int(push.width) || y >= int(push.height)) continue;
      uint other = (view * push.height + uint(y)) * push.width + uint(x);
      if (images.last_places.at[other].instance != place.instance) continue;
      float weight = max(0.0f, 1.0f - abs(place.film.x - float(x))) * max(0.0f, 1.0f - abs(place.film.y - float(y)));
      weight *= falling(surface_unlike(here, images.last_guides.at[other], 1.0f, 1e9f));
      weights += weight;
      variance += weight * images.last_pixels.at[other * history_words + history_variance];
      launches += weight * images.last_pixels.at[other * history_words + history_launches];
      for (uint p = 0u; p < planes; ++p) sum[p] += weight * images.last_light.at[other * planes + p];
    }
  }
  bool known = weights > 0.05f;
  launches = known ? launches / weights + 1.0f : 1.0f;
  if (known) {
    float before = 0.0f;
    for (uint p = 0u; p < planes; ++p) before += sum[p] / (weights * float(images.channels));
    vec2 levels = plausible_levels(pixel);
    float plausible = clamp(before, levels.x, levels.y);
    if (plausible != before) {
      launches = 0.5f * launches + 0.5f;
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
  float own = statistic(pixel, denoise_variance), rest = 1.0f - share;
  if (known) own = share * share * own + rest * rest * variance / weights;
  images.next_pixels.at[pixel * history_words + history_variance] = own;
  images.next_pixels.at[pixel * history_words + history_launches] = launches;
  float inside = statistic(pixel, denoise_inside);
  set_statistics(pixel, level, own, inside, inside);
}

float binomial(int i) { return i == 0 ? 0.375f : abs(i) == 1 ? 0.25f : 0.0625f; }

/// Mean over 3 x 3 pixels: a variance that is too low at one pixel must not keep it from mixing.
float smooth_variance(uint pixel) {
  float sum = 0.0f, weights = 0.0f;
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx) {
      uint other = neighbour(pixel, dx, dy);
      if (other == miss) continue;
      float weight = (dx == 0 ? 2.0f : 1.0f) * (dy == 0 ? 2.0f : 1.0f);
      sum += weight * statistic(other, denoise_smooth_variance);
      weights += weight;
    }
  return sum / weights;
}

void atrous(uint pixel) {
  GuideRecord here = push.guides.at[pixel];
  float level = statistic(pixel, denoise_smooth_level), own = smooth_variance(pixel), confidence = statistic(pixel, denoise_confidence);
  const uint most_planes = 15u;
  float sum[15], weights = 0.0f, variance = 0.0f, support = 0.0f;
  uint planes = plane_count();
  for (uint p = 0u; p < most_planes; ++p) sum[p] = 0.0f;
  for (int dy = -2; dy <= 2; ++dy)
    for (int dx = -2; dx <= 2; ++dx) {
      uint other = neighbour(pixel, dx * int(push.spacing), dy * int(push.spacing));
      if (other == miss) continue;
      float t = other == pixel ? 0.0f : surface_unlike(here, push.guides.at[other], float(max(abs(dx), abs(dy))) * float(push.spacing), 1e9f);
      if (t >= unlike) continue;
      float kernel = binomial(dx) * binomial(dy), there = statistic(other, denoise_smooth_level);
      float trust = statistic(other, denoise_confidence), noise = max(own, statistic(other, denoise_smooth_variance));
      support += kernel * falling(t) * trust;
      t += abs(there - level) * confidence / (level_reach * sqrt(noise) + 1e-3f * abs(level) + 1e-12f);
      float weight = kernel * falling(t) * trust;
      if (other == pixel) weight = max(weight, 1e-4f);
      weights += weight;
      variance += weight * weight * statistic(other, denoise_variance);
      for (uint p = 0u; p < planes; ++p) sum[p] += weight * push.light_in.at[other * planes + p];
    }
  float mean = 0.0f;
  for (uint p = 0u; p < planes; ++p) {
    sum[p] /= weights;
    push.light_out.at[pixel * planes + p] = sum[p];
    mean += sum[p] / float(push.images.at[0].channels);
  }
  set_statistics(pixel, mean, variance / (weights * weights), max(confidence, min(1.0f, 2.0f * support)), statistic(pixel, denoise_inside));
}

void multiply(uint pixel) {
  DenoiseImages images = push.images.at[0];
  vec3 albedo = push.guides.at[pixel].albedo;
  for (uint k = 0u; k < images.denoised_count; ++k)
    for (uint c = 0u; c < images.channels; ++c)
      images.denoised[k].at[pixel * images.channels + c] = push.light_in.at[pixel * plane_count() + k * images.channels + c] * albedo[int(c)];
}

void sum_images(uint pixel) {
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
  if (push.step == denoise_divide) divide(pixel);
  if (push.step == denoise_despeckle) despeckle(pixel);
  if (push.step == denoise_accumulate) accumulate(pixel);
  if (push.step == denoise_smooth) smooth_levels(pixel);
  if (push.step == denoise_atrous) atrous(pixel);
  if (push.step == denoise_multiply) multiply(pixel);
  if (push.step == denoise_sum) sum_images(pixel);
}
