// SPDX-License-Identifier: Apache-2.0
// Light at a vertex of stage `shade`: asked for by a shadow ray, before visibility, or found by the path's own ray and weighted against the light samples that
// might have found it.
/// Where glass may bend the way to a light.
struct GlassSeek {
  bool found;
  uint box;      // SceneAddresses.glass_boxes
  float chance, random;  // as bend_chance and bend_random
  float weight;          // 1 over the chance of looking at all
};

/// A light that a vertex asks, before visibility.
struct LightRequest {
  bool found;
  float probability;  // of this light among all
  bool projector;
  uint group;  // of light that is no projector's
  uint index;  // of the light
  GlassSeek seek;
  LightSample light;
};

struct ShadowRequest {
  bool wanted;
  bool opaque;  // glass stops it
  Ray ray;
  Spectrum contribution;
  uint group;
  GlassSeek seek;   // what follows is for that
  uint light;       // its index
  Spectrum weight;  // of what arrives, without BSDF or phase function
};

GlassSeek no_glass() { return GlassSeek(false, 0u, 0.0f, 0.0f, 1.0f); }

ShadowRequest no_shadow_request() { return ShadowRequest(false, false, empty_ray(), Spectrum(0.0f), 0u, no_glass(), 0u, Spectrum(0.0f)); }

void set_seek(INOUT(ShadowRequest) request, IN(LightRequest) asked, Spectrum throughput) {
  request.seek = asked.seek;
  request.light = asked.index;
  request.weight = throughput * (asked.seek.weight / asked.probability);
}

/// Most vertices behind a rough surface bring little each: of four, one looks for bent ways.
GlassSeek looked_at_less(GlassSeek seek, bool crosses) {
  const float chance = 0.25f;
  bool looks = seek.random < chance;
  seek.found = seek.found && (looks || crosses);
  seek.random = looks ? seek.random / chance : -1.0f;
  if (!looks) seek.chance = 0.0f;
  seek.weight = 1.0f / chance;
  return seek;
}

/// Where to look for bent ways beside the straight one. Glass near the straight way is looked at with a chance that falls as what it focuses there does.
GlassSeek seek_glass(IN(Path) path, vec3 origin, IN(LightSample) light, uint k) {
  const float sure = 1.44f, least = 0.003f;  // squared distance from the middle, in radii; chance
  IN(SceneAddresses) scene = push.scene.at[0];
  GlassSeek seek = no_glass();
  vec3 inverse = vec3(1.0f) / (abs(light.direction) + vec3(1e-30f)) * (step(vec3(0.0f), light.direction) * 2.0f - 1.0f);
  float nearest = 1e30f, sum = 0.0f;
  vec2 random = sample_2d(path.key, path.index, pair_bend(push.bounce, k));
  float u = random.x;
  bool crosses = false;
  for (uint i = 0u; i < scene.glass_box_count; ++i) {
    IN(GlassBox) box = scene.glass_boxes.at[i];
    vec3 a = (box.min - origin) * inverse, b = (box.max - origin) * inverse, near = min(a, b), far = max(a, b);
    bool crossed = max(max(near.x, near.y), max(near.z, 0.0f)) <= min(min(far.x, far.y), min(far.z, light.distance_m));
    vec3 middle = 0.5f * (box.min + box.max), radii = 0.5f * (box.max - box.min);
    float along = clamp(dot(middle - origin, light.direction), 0.0f, light.distance_m);
    vec3 beside = (origin + light.direction * along - middle) / radii;
    float distance_squared = dot(beside, beside), chance = min(1.0f, sure * sure / (distance_squared * distance_squared));
    if (chance < least) chance = 0.0f;
    if (crossed && distance_squared < nearest) {
      nearest = distance_squared;
      seek = GlassSeek(true, i, u < chance ? chance : 0.0f, random.y, 1.0f);
      crosses = true;
    } else if (!crosses) {
      // One of all: each has its part of [0, 1), and those that find no place there are left out.
      if (u >= sum && u < sum + chance) seek = GlassSeek(true, i, chance, random.y, 1.0f);
      sum += chance;
    }
  }
  return all_delta(path) ? seek : looked_at_less(seek, crosses);
}

void find_light(IN(Path) path, vec3 position, vec3 shape_origin, uint k, OUT(LightRequest) request) {
  request.found = false;
  IN(SceneAddresses) scene = push.scene.at[0];
  bool select = (push.flags & shade_select_lights) != 0u;
  float u = select ? sample_2d(path.key, path.index, pair_light(push.bounce)).x : 0.0f;
  IN(EnvironmentRecord) environment = scene.environments.at[path_environment(path)];
  LightChoice choice = vertex_light(scene.lights, environment, k, select, all_delta(path), u);
  request.probability = choice.probability;
  if (choice.probability == 0.0f) return;
  IN(LightRecord) record = scene.lights.at[choice.index];
  request.projector = record.kind == light_projector;
  vec2 point = vec2(0.0f);
  if ((features & feature_lights) != 0u) {
    point = sample_2d(path.key, path.index, pair_light_point(push.bounce, k));
    position = shape_origin;
  }
  request.light = light_towards(scene, choice.index, position, point, path.time_s);
  request.seek = no_glass();
  if (request.light.pdf > 0.0f && (push.flags & shade_bsdf_only) != 0u) return;
  bool mesh = (features & feature_lights) != 0u && record.kind == light_mesh;
  request.group = ambient_group(mesh ? request.light.light_group : record.light_group);
  request.found = max_component(request.light.irradiance) > 0.0f;
  request.index = choice.index;
  if ((push.flags & shade_bends) != 0u && request.light.pdf == 0.0f) request.seek = seek_glass(path, position, request.light, k);
  request.found = request.found || request.seek.found;  // what is dark on the straight way may be lit on the bent one
}

/// Weight of light `index` where the path's direction, not a light sample, found it; pdf: that of the light sample.
float found_weight(IN(Path) path, uint index, float pdf) {
  if (path.pdf == 0.0f || (push.flags & shade_bsdf_only) != 0u) return 1.0f;
  if ((push.flags & shade_lights_only) != 0u) return 0.0f;
  IN(LightRecord) light = push.scene.at[0].lights.at[index];
  if ((push.flags & shade_select_lights) != 0u) pdf *= (path.flags & path_after_first) != 0u ? light.other_probability : light.probability;
  return mis_weight(path.pdf, pdf);
}

float emission_weight(IN(Path) path, IN(MaterialRecord) m, float t, float cosine) {
  if ((features & feature_lights) == 0u) return 1.0f;
  uint index = push.scene.at[0].environments.at[path_environment(path)].mesh_light;
  return index == miss ? 1.0f : found_weight(path, index, mesh_pdf(m, push.scene.at[0].light_shapes.at[index], t, cosine));
}
