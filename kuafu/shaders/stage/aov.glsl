// Depth, normal and ids of what the ray through each pixel's centre met.
void write_word(uint kind, Pixel pixel, uint channel_count, uint channel, uint value) {
  OutputRecord record = push.outputs.at[kind];
  if (record.enabled != 0u) record.words.at[output_element(record, pixel, channel_count) + channel] = value;
}

/// Length of the ray to z = 1 in the camera.
float metres_per_z(ViewRecord view, Pixel pixel) {
  vec2 film = vec2(float(pixel.column), float(pixel.row));
  if ((features & feature_camera) == 0u || (push.flags & generate_camera) == 0u) return length(view.axis_0 + film.x * view.axis_u + film.y * view.axis_v);
  return length(camera_ray(view, push.cameras.at[pixel.view], pixel, push.range, FilmSample(film, vec2(0.0f), 0.0f)).direction);
}

uint hit_word(uint i, uint field) { return push.rays.at[closest_word(i, field, push.range.capacity)]; }

void aov(uint i) {
  Pixel pixel = wave_pixel(push.range, i);
  float z = 0.0f;
  vec3 normal = vec3(0.0f);
  uint instance_id = miss, material_id = miss;
  if (hit_word(i, hit_geometry) != miss) {
    SceneAddresses scene = push.scene.at[0];
    ViewRecord view = push.views.at[pixel.view];
    Surface s = load_surface(scene, scene.instances.at[hit_word(i, hit_instance)], hit_word(i, hit_primitive),
                             uintBitsToFloat(hit_word(i, hit_u)), uintBitsToFloat(hit_word(i, hit_v)));
    MaterialRecord m = scene.materials.at[s.material];
    load_material(scene, m, s);
    z = uintBitsToFloat(hit_word(i, ray_t_far)) / metres_per_z(view, pixel);
    bool front = dot(s.geometric_normal, load_direction(push.rays, i, push.range.capacity)) <= 0.0f;
    normal = front ? s.shading_normal : -s.shading_normal;
    instance_id = s.instance_id;
    material_id = m.id;
  }
  write_word(output_depth, pixel, 1u, 0u, floatBitsToUint(z));
  write_word(output_normal, pixel, 3u, 0u, floatBitsToUint(normal.x));
  write_word(output_normal, pixel, 3u, 1u, floatBitsToUint(normal.y));
  write_word(output_normal, pixel, 3u, 2u, floatBitsToUint(normal.z));
  write_word(output_instance_id, pixel, 1u, 0u, instance_id);
  write_word(output_material_id, pixel, 1u, 0u, material_id);
}
