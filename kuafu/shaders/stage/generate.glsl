// SPDX-License-Identifier: Apache-2.0
// Primary rays: one path per pixel and sample, uniform over the pixel's square (box filter, blurred or not), the lens and the exposure.

uint path_count() {
  uint pixels = push.range.pixel_count;
  if ((push.flags & generate_listed) != 0u) {
    uint listed = push.pixels.at[0];
    pixels = min(pixels, listed - min(listed, push.range.first_pixel));
  }
  return pixels * push.range.sample_count;
}

/// Which sample of which pixel a slot is.
Pixel slot_pixel(uint slot, OUT(uint) index) {
  uint local_pixel = slot / push.range.sample_count;
  index = push.range.first_sample + slot - local_pixel * push.range.sample_count;
  if ((push.flags & generate_listed) == 0u) return wave_pixel(push.range, local_pixel);
  return image_pixel(push.range, push.pixels.at[1u + push.range.first_pixel + local_pixel]);
}

uint pixel_word(Pixel pixel) { return pixel.row * push.range.width + pixel.column; }
bool through_centres() { return (push.flags & generate_pixel_centre) != 0u; }
bool in_replicates() { return (push.flags & generate_replicates) != 0u; }

/// A uniform value of -0.5..0.5 becomes one by the density of a pixel's width that is blurred by a box: the inverse of its integral.
float blurred(float uniform_value) {
  float w = push.blur_px, v = abs(uniform_value);
  float far = v <= 0.5f * (1.0f - w) ? v : 0.5f * (1.0f + w) - sqrt(max(w * (1.0f - 2.0f * v), 0.0f));
  return uniform_value < 0.0f ? -far : far;
}

/// The path's ray from the camera.
void start_ray(uint slot, Pixel pixel, uint key, uint index, vec2 offset) {
  IN(ViewRecord) view = push.views.at[pixel.view];
  bool centre = through_centres();
  if (push.blur_px > 0.0f) offset = vec2(blurred(offset.x), blurred(offset.y));
  vec2 image_point = vec2(float(pixel.column), float(pixel.row)) + offset;
  float time_s = 0.0f;
  vec3 origin = view.origin, ray = view.axis_0 + image_point.x * view.axis_u + image_point.y * view.axis_v;
  if ((features & feature_camera) != 0u && (push.flags & generate_camera) != 0u) {
    CameraSample s = CameraSample(image_point, vec2(0.0f), 0.0f);
    if (!centre) {
      s.lens = unit_disk(sample_2d(key, index, pair_lens));
      s.moment = sample_2d(key, index, pair_time).x - 0.5f;
    }
    CameraRay moved = camera_ray(view, push.cameras.at[pixel.view], pixel, push.range, s);
    origin = moved.origin;
    ray = moved.direction;
    if ((push.flags & generate_motion) != 0u) time_s = moved.time_s;
  }
  float metres_per_z = length(ray);  // ray length for one metre of z
  uint capacity = push.range.capacity;
  store_closest_ray(push.rays, slot, capacity, Ray(origin, view.near_m * metres_per_z, ray / metres_per_z, view.far_m * metres_per_z),
                    time_s, slot);
  if ((push.flags & generate_environments) != 0u) push.ray_environments.at[slot] = view.environment;
}

/// Whether paths follow the rays.
bool starts_paths() { return !through_centres() && (push.flags & generate_rays_only) == 0u; }

void start_path(uint slot, uint environment, uint key, uint index) {
  uint capacity = push.range.capacity;
  push.state.at[state_pixel_key * capacity + slot] = key;
  push.state.at[state_sample * capacity + slot] = index;
  push.state.at[state_flags * capacity + slot] = environment | path_all_delta;
  uint plane = state_throughput;
  for (; plane < state_radiance(push.channels); ++plane) push.state.at[plane * capacity + slot] = floatBitsToUint(1.0f);
  for (; plane < state_shadow(push.channels, push.groups); ++plane) push.state.at[plane * capacity + slot] = 0u;
}

void generate(uint slot) {
  uint index;
  Pixel pixel = slot_pixel(slot, index);
  PixelSample s = pixel_sample(push.views.at[pixel.view].key, pixel_word(pixel), index, in_replicates());
  start_ray(slot, pixel, s.key, s.index, through_centres() ? vec2(0.0f) : s.offset);
  if (starts_paths()) start_path(slot, push.views.at[pixel.view].environment, s.key, s.index);
}
