// SPDX-License-Identifier: Apache-2.0
// What a medium does to a path, as a part of stage `shade`: each way that lies in it is dimmed, and has one vertex where light is scattered. The vertex asks
// for shadow rays of its own beside the surface's, so that light which only got dimmed stays as exact as without a medium. One of both goes on.
struct FogVertex {
  bool found;
  vec3 position, direction;  // of the ray
  Spectrum throughput;
};

bool in_medium() { return (features & feature_medium) != 0u && (push.flags & shade_medium) != 0u; }

/// The medium along a shadow ray in the open: glass takes back what lies within it (stage `transmit`).
Spectrum open_transmittance(vec3 origin, vec3 direction, float distance_m) {
  if (!in_medium()) return Spectrum(1.0f);
  return medium_transmittance(push.scene.at[0].medium.at[0], origin, direction, 0.0f, distance_m);
}

/// Metres of a path's ray before the medium may begin: a camera's housing keeps it out.
float clear_way_m() { return push.bounce == 0u ? push.scene.at[0].medium.at[0].housing_m : 0.0f; }

/// The medium along a path's ray in the open.
Spectrum path_transmittance(vec3 origin, vec3 direction, float distance_m) {
  if (!in_medium()) return Spectrum(1.0f);
  return medium_transmittance(push.scene.at[0].medium.at[0], origin, direction, clear_way_m(), distance_m);
}

/// Whether ray i ran inside a body, which keeps the medium out.
bool ran_inside(uint i, IN(Path) path) {
  if (path.body != 0u) return true;
  if (ray_field(i, hit_geometry) == miss) return false;
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, ray_field(i, hit_instance), ray_field(i, hit_primitive), 0.0f, 0.0f, path.time_s);
  IN(MaterialRecord) m = scene.materials.at[s.material];
  return dot(s.geometric_normal, load_direction(push.rays_in, i, push.capacity)) > 0.0f && m.transmission + m.diffuse_transmission > 0.0f && m.thin_walled == 0u;
}

FogVertex sample_fog(IN(Path) path, vec3 origin, vec3 direction, float t_far) {
  FogVertex fog = FogVertex(false, vec3(0.0f), direction, Spectrum(0.0f));
  IN(MediumRecord) medium = push.scene.at[0].medium.at[0];
  vec2 part = medium_part(medium, origin, direction, clear_way_m(), t_far);
  if (part.y <= part.x || max_component(medium_albedo(medium)) == 0.0f) return fog;
  Flight flight = sample_flight(medium, part.y - part.x, sample_2d(path.key, path.index, pair_flight(push.bounce)));
  fog.throughput = path.throughput * flight.weight;
  fog.found = max_component(fog.throughput) > 0.0f;
  fog.position = origin + direction * (part.x + flight.t);
  return fog;
}

/// The k-th shadow ray of the fog's vertex. What it gives is projector indirect: light that only got dimmed is not in it.
ShadowRequest ask_light_in_fog(IN(Path) path, IN(FogVertex) fog, uint k) {
  ShadowRequest request = no_shadow_request();
  IN(SceneAddresses) scene = push.scene.at[0];
  LightRequest asked;
  find_light(path, fog.position, fog.position, k, asked);
  if (!asked.found) return request;
  float pdf = phase(scene.medium.at[0].phase_g, dot(fog.direction, asked.light.direction));
  request.contribution = fog.throughput * asked.light.irradiance * (pdf / asked.probability);
  request.contribution *= open_transmittance(fog.position, asked.light.direction, asked.light.distance_m);
  request.opaque = asked.light.pdf > 0.0f;
  if (request.opaque && (push.flags & shade_lights_only) == 0u) request.contribution *= mis_weight(asked.light.pdf * asked.probability, pdf);
  request.wanted = max_component(request.contribution) > 0.0f;
  request.group = asked.projector ? group_projector_indirect : asked.group;
  request.ray = Ray(fog.position, 0.0f, asked.light.direction, asked.light.distance_m * 0.99999f);
  return request;
}

/// Chance that the path goes on from the fog, not from the surface behind it. Exactly 1 without a surface: a GPU's x / x may be a little less, and one
/// path in ten million would then be scattered by what is no vertex.
float fog_chance(IN(Path) path, IN(FogVertex) fog, bool hit) {
  if (!fog.found) return 0.0f;
  if (!hit) return 1.0f;
  float scattered = max_component(fog.throughput);
  return scattered / (scattered + max_component(path.throughput));
}

/// The next ray from the fog; the path takes its throughput, divided by its chance.
NextRequest scatter_in_fog(INOUT(Path) path, IN(FogVertex) fog, float chance) {
  NextRequest request = no_next_request();
  float g = push.scene.at[0].medium.at[0].phase_g;
  vec3 local = sample_phase(g, sample_2d(path.key, path.index, pair_direction(push.bounce)));
  path.throughput = fog.throughput / chance;
  path.pdf = phase(g, local.z);
  request.wanted = true;
  request.ray = Ray(fog.position, 0.0f, to_world(frame_around(fog.direction), local), uintBitsToFloat(0x7f800000u));
  return request;
}
