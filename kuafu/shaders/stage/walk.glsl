// SPDX-License-Identifier: Apache-2.0
// Light below a surface, as a part of stage `shade`: a path that enters a body wanders in it from scattering to scattering, one flight per pass of the wave,
// and leaves as a diffuse surface gives light (Chiang, Kutz, Burley, "Practical and Controllable Subsurface Scattering for Production Path Tracing", 2016).
// Passes of the walk are no bounces. At walk_limit passes the path flies straight out, with the weight that its rest would have on average.
struct Walk {
  bool inside;     // the path is in a body
  bool scattered;  // and stays there: its next ray starts at `position`
  vec3 position;
};

float one_channel(Spectrum weights, float u, OUT(uint) chosen) {
  float sum = 0.0f;
  for (uint c = 0u; c < channels; ++c) sum += channel_of(weights, c);
  chosen = 0u;
  float rest = u * sum - channel_of(weights, 0u);
  while (rest >= 0.0f && chosen + 1u < channels) rest -= channel_of(weights, ++chosen);
  return sum;
}

float weighted_sum(Spectrum a, Spectrum b) {
  float sum = 0.0f;
  for (uint c = 0u; c < channels; ++c) sum += channel_of(a, c) * channel_of(b, c);
  return sum;
}

/// Mean of albedo^m over the lengths m of what is left of a walk that has not left a half space by step n. Those are distributed as n^-3/2 (first passage of
/// a diffusion), which gives 1 - sqrt(pi) y erfcx(y) with y^2 = -n log(albedo); erfcx by its bound 2 / (sqrt(pi) (y + sqrt(y^2 + 4 / pi))).
float rest_of_walk(float albedo, float n) {
  float y2 = -n * log(max(albedo, 1e-6f)), y = sqrt(max(y2, 0.0f)), root = sqrt(max(y2, 0.0f) + 4.0f / pi);
  return (root - y) / (root + y);
}

/// Goes on from a surface into the body below it; share: what the surface lets in, per chance of this choice.
NextRequest enter_body(INOUT(Path) path, IN(Vertex) vertex, float share) {
  NextRequest request = no_next_request();
  vec3 down = sample_cosine(sample_2d(path.key, path.index, pair_direction(push.bounce)));
  request.wanted = true;
  request.ray = Ray(offset_origin(vertex.position, vertex.coordinate_size, -vertex.side_normal), 0.0f,
                    to_world(frame_around(-vertex.side_normal), down), uintBitsToFloat(0x7f800000u));
  path.throughput *= share;
  path.flags |= path_inside;
  return request;
}

/// The surface from below: white.
Vertex exit_vertex(IN(Surface) s, MaterialPoint m) {
  Vertex vertex;
  vertex.position = s.position;
  vertex.coordinate_size = s.coordinate_size;
  vertex.side_normal = s.geometric_normal;
  vertex.frame = frame_around(s.shading_normal);
  vertex.wo = vec3(0.0f, 0.0f, 1.0f);
  m.metallic = m.transmission = m.transmission_roughness = m.diffuse_roughness = m.subsurface = m.diffuse_transmission = m.anisotropy = 0.0f;
  m.base = Spectrum(1.0f);
  vertex.material = m;
  vertex.front = vertex.from_below = true;
  return vertex;
}

/// One flight of ray i in its body. True: it left, at `vertex`.
bool walk_on(uint i, INOUT(Path) path, INOUT(Walk) walk, INOUT(Vertex) vertex) {
  path.flags += 1u << path_walk_shift;
  walk.inside = true;
  walk.scattered = false;
  if (ray_field(i, hit_geometry) == miss) return false;  // the body is open
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, ray_field(i, hit_instance), ray_field(i, hit_primitive),
                           uintBitsToFloat(ray_field(i, hit_u)), uintBitsToFloat(ray_field(i, hit_v)), path.time_s);
  IN(MaterialRecord) record = scene.materials.at[s.material];
  vec3 direction = load_direction(push.rays_in, i, push.capacity);
  if (record.subsurface == 0.0f || dot(s.geometric_normal, direction) <= 0.0f) return false;  // something stands in the body
  Spectrum albedo = band_of(record.subsurface_albedo);
  if (walked(path) >= walk_limit) {
#if KUAFU_CHANNELS == 1
    path.throughput *= rest_of_walk(albedo, float(walk_limit));
#else
    path.throughput *= vec3(rest_of_walk(albedo.x, float(walk_limit)), rest_of_walk(albedo.y, float(walk_limit)), rest_of_walk(albedo.z, float(walk_limit)));
#endif
  } else {
    Spectrum extinction = band_of(record.subsurface_extinction);
    float t_far = uintBitsToFloat(ray_field(i, ray_t_far));
    vec2 u = sample_2d(path.key, path.index, pair_flight(push.bounce));
    uint chosen;
    float sum = one_channel(path.throughput, u.y, chosen), t = min(-log(1.0f - u.x) / channel_of(extinction, chosen), t_far);
    Spectrum left = band_exp(extinction * -t);
    if (t < t_far) {
      float density = weighted_sum(path.throughput, extinction * left);
      path.throughput *= albedo * extinction * left * (sum / max(density, 1e-30f));
      walk.scattered = true;
      walk.position = load_origin(i) + direction * t;
      return false;
    }
    path.throughput *= left * (sum / max(weighted_sum(path.throughput, left), 1e-30f));
  }
  path.flags &= ~path_inside;
  walk.inside = false;
  vertex = exit_vertex(s, load_material(scene, record, s));
  return true;
}

/// The next ray of a path that was scattered in its body.
NextRequest wander(INOUT(Path) path, IN(Walk) walk) {
  NextRequest request = no_next_request();
  vec2 u = sample_2d(path.key, path.index, pair_direction(push.bounce));
  float cosine = 1.0f - 2.0f * u.x, sine = sqrt(max(1.0f - cosine * cosine, 0.0f)), phi = 2.0f * pi * u.y;
  request.wanted = survives(path, sample_2d(path.key, path.index, pair_choice(push.bounce)).y);
  request.ray = Ray(walk.position, 0.0f, vec3(sine * cos(phi), sine * sin(phi), cosine), uintBitsToFloat(0x7f800000u));
  return request;
}
