// SPDX-License-Identifier: Apache-2.0
// Stage `aov`: what the ray through each pixel's centre met. Where nothing was met, sizes are 0, ids "miss", places NaN.
const uint nan_bits = 0x7fc00000u;

void write_word(uint kind, Pixel pixel, uint channel_count, uint channel, uint value) {
  IN(OutputRecord) record = push.outputs.at[kind];
  if (record.enabled != 0u) record.words.at[output_element(record, pixel, channel_count) + channel] = value;
}

void write_float(uint kind, Pixel pixel, float value) { write_word(kind, pixel, 1u, 0u, floatBitsToUint(value)); }

void write_vec2(uint kind, Pixel pixel, bool valid, vec2 value) {
  write_word(kind, pixel, 2u, 0u, valid ? floatBitsToUint(value.x) : nan_bits);
  write_word(kind, pixel, 2u, 1u, valid ? floatBitsToUint(value.y) : nan_bits);
}

void write_vec3(uint kind, Pixel pixel, vec3 value) {
  write_word(kind, pixel, 3u, 0u, floatBitsToUint(value.x));
  write_word(kind, pixel, 3u, 1u, floatBitsToUint(value.y));
  write_word(kind, pixel, 3u, 2u, floatBitsToUint(value.z));
}

void write_albedo(Pixel pixel, Spectrum albedo) {
  for (uint c = 0u; c < channels; ++c) write_word(output_albedo, pixel, channels, c, floatBitsToUint(channel_of(albedo, c)));
}

/// Length of the ray to z = 1 in the camera.
float metres_per_z(IN(ViewRecord) view, Pixel pixel) {
  vec2 image_point = vec2(float(pixel.column), float(pixel.row));
  if ((features & feature_camera) == 0u || (push.flags & aov_camera) == 0u) return length(view.axis_0 + image_point.x * view.axis_u + image_point.y * view.axis_v);
  return length(camera_ray(view, push.cameras.at[pixel.view], pixel, push.range, CameraSample(image_point, vec2(0.0f), 0.0f)).direction);
}

uint hit_word(uint i, uint field) { return push.rays.at[closest_word(i, field, push.range.capacity)]; }

void write_nothing(Pixel pixel) {
  vec3 nowhere = vec3(uintBitsToFloat(nan_bits));
  write_float(output_depth, pixel, 0.0f);
  write_vec3(output_normal, pixel, vec3(0.0f));
  write_vec3(output_position, pixel, nowhere);
  write_albedo(pixel, Spectrum(0.0f));
  write_float(output_roughness, pixel, 0.0f);
  write_float(output_transmission, pixel, 0.0f);
  write_word(output_instance_id, pixel, 1u, 0u, miss);
  write_word(output_material_id, pixel, 1u, 0u, miss);
  write_word(output_semantic_id, pixel, 1u, 0u, miss);
  write_vec2(output_projector_uv, pixel, false, vec2(0.0f));
  write_float(output_projector_visibility, pixel, 0.0f);
  write_float(output_projector_geometry, pixel, 0.0f);
  write_vec2(output_motion, pixel, false, vec2(0.0f));
}

/// A ray that meets nothing, the empty one, keeps its place in the queue.
void ask_projector(uint i, Pixel pixel, IN(Ray) ray) {
  if ((push.flags & aov_visibility) == 0u) return;
  store_ray(push.shadow_rays, i, occlusion_words, push.shadow_capacity, ray, uintBitsToFloat(hit_word(i, ray_time)), i);
  if ((push.flags & aov_environments) != 0u) push.shadow_environments.at[i] = push.views.at[pixel.view].environment;
}

/// Visible until the shadow ray says otherwise.
void write_projector(uint i, Pixel pixel, IN(Surface) s, vec3 normal, vec3 side_normal) {
  ProjectorView view = ProjectorView(false, vec2(0.0f), 0.0f, empty_ray());
  ProjectorRecord projector = push.aov.at[0].projectors.at[push.views.at[pixel.view].environment];
  if (projector.found != 0u) view = projector_view(projector, s, normal, side_normal);
  bool lit = view.inside && view.geometry > 0.0f;
  write_vec2(output_projector_uv, pixel, view.inside, view.pixel);
  write_float(output_projector_geometry, pixel, view.geometry);
  write_float(output_projector_visibility, pixel, lit ? 1.0f : 0.0f);
  if (lit) ask_projector(i, pixel, view.ray);
  else ask_projector(i, pixel, empty_ray());
}

void write_motion(uint i, Pixel pixel, IN(InstanceRecord) instance, vec3 position) {
  AovAddresses aov = push.aov.at[0];
  MotionView view = aov.motion.at[pixel.view];
  vec3 before = moved_position(instance, hit_word(i, hit_primitive), uintBitsToFloat(hit_word(i, hit_u)), uintBitsToFloat(hit_word(i, hit_v)),
                               aov.previous_local_to_world, 3u * hit_word(i, hit_instance));
  if ((features & feature_motion) != 0u && push.scene.at[0].moves != 0u)  // what it does while the shutter is open, it did then, too
    before += position - standing_position(instance, hit_word(i, hit_primitive), uintBitsToFloat(hit_word(i, hit_u)), uintBitsToFloat(hit_word(i, hit_v)));
  vec2 image_point = vec2(0.0f), image_point_before = vec2(0.0f);
  bool seen = project_to_image(view, view.now, position, image_point);
  seen = project_to_image(view, view.previous, before, image_point_before) && seen;
  write_vec2(output_motion, pixel, seen, image_point - image_point_before);
}

void write_surface(uint i, Pixel pixel) {
  IN(SceneAddresses) scene = push.scene.at[0];
  IN(InstanceRecord) instance = scene.instances.at[hit_word(i, hit_instance)];
  Surface s = surface_at(scene, hit_word(i, hit_instance), hit_word(i, hit_primitive), uintBitsToFloat(hit_word(i, hit_u)),
                         uintBitsToFloat(hit_word(i, hit_v)), uintBitsToFloat(hit_word(i, ray_time)));
  IN(MaterialRecord) m = scene.materials.at[s.material];
  MaterialPoint point = load_material(scene, m, s);
  bool front = dot(s.geometric_normal, load_direction(push.rays, i, push.range.capacity)) <= 0.0f;
  vec3 normal = front ? s.shading_normal : -s.shading_normal;
  write_float(output_depth, pixel, uintBitsToFloat(hit_word(i, ray_t_far)) / metres_per_z(push.views.at[pixel.view], pixel));
  write_vec3(output_normal, pixel, normal);
  write_vec3(output_position, pixel, s.position);
  write_albedo(pixel, point.base);
  write_float(output_roughness, pixel, point.roughness);
  write_float(output_transmission, pixel, point.transmission);
  write_word(output_instance_id, pixel, 1u, 0u, s.instance_id);
  write_word(output_material_id, pixel, 1u, 0u, m.id);
  write_word(output_semantic_id, pixel, 1u, 0u, instance.semantic_id);
  if ((push.flags & aov_projector) != 0u) write_projector(i, pixel, s, normal, front ? s.geometric_normal : -s.geometric_normal);
  if ((push.flags & aov_motion) != 0u) write_motion(i, pixel, instance, s.position);
}

void aov(uint i) {
  Pixel pixel = wave_pixel(push.range, i);
  if (hit_word(i, hit_geometry) != miss) {
    write_surface(i, pixel);
  } else {
    write_nothing(pixel);
    ask_projector(i, pixel, empty_ray());
  }
}
