// SPDX-License-Identifier: Apache-2.0
// Lights with an extent or a profile: sampled towards a point, and met by rays. Radiance / pdf takes the place of an irradiance; pdf (per solid angle) is 0
// for lights without extent, which no ray meets. Light shapes do not block: only scene surfaces do.
#ifndef KUAFU_LIGHT_SHAPE_GLSL
#define KUAFU_LIGHT_SHAPE_GLSL
#include "lib/cutout.glsl"
#include "lib/distortion.glsl"
#include "lib/frame.glsl"
#include "lib/light.glsl"
#include "lib/material.glsl"
#include "lib/microfacet.glsl"

const float infinite_m = 3.0e38f;

struct ShapeHit {
  bool found;
  float t;
  Spectrum radiance;
  float pdf;  // of sample_light for this direction, without the choice of the light
};

vec3 to_light_frame(IN(LightShape) s, vec3 w) { return vec3(dot(s.axis_x, w), dot(s.axis_y, w), dot(s.axis_z, w)); }
vec3 from_light_frame(IN(LightShape) s, vec3 v) { return s.axis_x * v.x + s.axis_y * v.y + s.axis_z * v.z; }

Spectrum light_texel(IN(SceneAddresses) scene, uint texture, vec2 uv) {
  vec4 t = texture_repeat(scene.textures.at[texture], uv);
  return band_of(xyz(t));
}

/// Equirectangular: the middle column looks along the frame's +z, columns go towards +x, row 0 looks along -y (up).
vec2 sphere_uv(vec3 d) {
  float azimuth = d.x == 0.0f && d.z == 0.0f ? 0.0f : atan(d.x, d.z);  // GLSL leaves atan(0, 0) open
  return vec2(0.5f + azimuth * (0.5f / pi), acos(clamp(-d.y, -1.0f, 1.0f)) / pi);
}

vec3 sphere_direction(vec2 uv) {
  float phi = (uv.x - 0.5f) * 2.0f * pi, theta = uv.y * pi, s = sin(theta);
  return vec3(s * sin(phi), -cos(theta), s * cos(phi));
}

/// Uniform in a cone of solid angle 2 pi one_minus_cos around z.
vec3 sample_cone(float one_minus_cos, vec2 u) {
  float h = u.x * one_minus_cos, s = sqrt(max(h * (2.0f - h), 0.0f)), phi = 2.0f * pi * u.y;
  return vec3(s * cos(phi), s * sin(phi), 1.0f - h);
}

/// Where a direction of the projector's frame meets its pattern; false behind it, and where its lens does not reach.
bool pattern_pixel(IN(LightShape) s, vec3 d, OUT(vec2) pixel) {
  if (d.z <= 0.0f) return false;
  vec2 p = xy(d) / d.z;
  if (dot(p, p) > s.lens_reach * s.lens_reach) return false;
  vec2 q = distort(s.lens, p);
  pixel = vec2(s.focal.x * q.x + s.skew * q.y + s.centre.x, s.focal.y * q.y + s.centre.y);
  return true;
}

/// Relative intensity of a projector: pattern through the distorting lens, cos^n towards the edge, and a disc of confusion that grows with |1/z - 1/z0|.
float projected(IN(LightRecord) light, IN(LightShape) s, vec3 away, vec2 u) {
  vec3 d = to_light_frame(s, away);
  vec2 pixel;
  if (!pattern_pixel(s, d, pixel)) return 0.0f;
  if (s.radius_m > 0.0f && s.focus_m > 0.0f) {
    float radius = s.radius_m * abs(1.0f / d.z - 1.0f / s.focus_m) * sqrt(u.x), phi = 2.0f * pi * u.y;
    pixel += s.focal * vec2(radius * cos(phi), radius * sin(phi));
  }
  Pattern pattern = Pattern(light.pattern, light.width, light.height, light.pattern_bits);
  float value = pattern_bilinear(pattern, pixel);
  return s.falloff == 0.0f ? value : value * pow(d.z / length(d), s.falloff);
}

/// What the profile of a light without extent gives towards `away`, its intensity being 1.
Spectrum profile(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 away, vec2 u) {
  if (light.kind == light_projector) return Spectrum(projected(light, s, away, u));
  if (light.kind == light_point) return s.texture == no_texture ? Spectrum(1.0f) : light_texel(scene, s.texture, sphere_uv(to_light_frame(s, away)));
  vec3 d = to_light_frame(s, away);  // a spot, as KHR_lights_punctual shapes it
  float inside = clamp((d.z - s.cos_outer) / max(s.cos_inner - s.cos_outer, 1e-4f), 0.0f, 1.0f);
  Spectrum value = Spectrum(inside * inside);
  if (s.texture != no_texture && d.z > 0.0f)
    value *= light_texel(scene, s.texture, xy(d) * (0.5f / (d.z * max(sqrt(1.0f - s.cos_outer * s.cos_outer) / s.cos_outer, 1e-6f))) + 0.5f);
  return value;
}

bool is_flat(uint kind) { return kind == light_rectangle || kind == light_disk; }

float flat_area(IN(LightRecord) light, IN(LightShape) s) {
  return light.kind == light_disk ? pi * s.radius_m * s.radius_m : 4.0f * s.half_size.x * s.half_size.y;
}

/// Radiance of a rectangle or disk at (x, y) of its plane, in metres.
Spectrum flat_radiance(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec2 p) {
  Spectrum radiance = band_of(light.intensity);
  if (s.texture == no_texture) return radiance;
  vec2 half_size = light.kind == light_disk ? vec2(s.radius_m) : s.half_size;
  return radiance * light_texel(scene, s.texture, clamp(p / half_size * 0.5f + 0.5f, 0.0f, 0.999999f));
}

LightSample sample_flat(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 position, vec2 u) {
  vec2 p = (u * 2.0f - 1.0f) * s.half_size;
  if (light.kind == light_disk) {
    float radius = s.radius_m * sqrt(u.x), phi = 2.0f * pi * u.y;
    p = vec2(radius * cos(phi), radius * sin(phi));
  }
  LightSample l;
  vec3 way = light.position + s.axis_x * p.x + s.axis_y * p.y - position;
  l.distance_m = sqrt(max(dot(way, way), 1e-20f));
  l.direction = way / l.distance_m;
  float cosine = -dot(l.direction, s.axis_z);
  l.pdf = cosine > 0.0f ? l.distance_m * l.distance_m / (cosine * flat_area(light, s)) : 0.0f;
  l.irradiance = cosine > 0.0f ? flat_radiance(scene, light, s, p) / l.pdf : Spectrum(0.0f);
  return l;
}

/// 1 - cos of the half angle under which a sphere is seen; 0 from inside.
float sphere_cap(float radius_m, float distance_squared) {
  float sin2 = radius_m * radius_m / distance_squared;
  return sin2 < 1.0f ? sin2 / (1.0f + sqrt(1.0f - sin2)) : 0.0f;
}

LightSample sample_sphere(IN(LightRecord) light, IN(LightShape) s, vec3 position, vec2 u) {
  LightSample l;
  vec3 way = light.position - position;
  float distance_squared = max(dot(way, way), 1e-20f), distance = sqrt(distance_squared);
  float cap = sphere_cap(s.radius_m, distance_squared);
  vec3 local = sample_cone(cap, u);
  l.direction = to_world(frame_around(way / distance), local);
  float half_chord = s.radius_m * s.radius_m - distance_squared * (1.0f - local.z * local.z);
  l.distance_m = distance * local.z - sqrt(max(half_chord, 0.0f));
  l.pdf = cap > 0.0f ? 1.0f / (2.0f * pi * cap) : 0.0f;
  l.irradiance = cap > 0.0f ? band_of(light.intensity) / (pi * s.radius_m * s.radius_m * l.pdf) : Spectrum(0.0f);
  return l;
}

// E = L pi sin^2 of the half angle.
Spectrum disc_radiance(IN(LightRecord) light, IN(LightShape) s) {
  return band_of(light.intensity) / (pi * s.one_minus_cos * (2.0f - s.one_minus_cos));
}

/// A directional light's texture stands across it in tiles of the given size, centred on the light's position.
Spectrum tile(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 position) {
  if (s.texture == no_texture) return Spectrum(1.0f);
  vec3 d = to_light_frame(s, position - light.position);
  return light_texel(scene, s.texture, xy(d) * (vec2(0.5f) / s.half_size) + 0.5f);
}

LightSample sample_directional(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 position, vec2 u) {
  LightSample l;
  l.direction = -s.axis_z;
  l.distance_m = infinite_m;
  l.pdf = 0.0f;
  l.irradiance = band_of(light.intensity);
  if (s.one_minus_cos > 0.0f) {
    l.direction = to_world(frame_around(-s.axis_z), sample_cone(s.one_minus_cos, u));
    l.pdf = 1.0f / (2.0f * pi * s.one_minus_cos);
    l.irradiance = disc_radiance(light, s) / l.pdf;
  }
  l.irradiance *= tile(scene, light, s, position);
  return l;
}

/// First index in [first, first + count) of an ascending table whose value is above u.
uint search_above(FloatArray table, uint first, uint count, float u) {
  uint low = first, high = first + count - 1u;
  while (low < high) {
    uint middle = (low + high) / 2u;
    if (u < table.at[middle]) high = middle;
    else low = middle + 1u;
  }
  return low;
}

// Every point of the emissive meshes, by power: the density per area is the emission's largest channel over the sum of it times area.
LightSample sample_mesh(IN(SceneAddresses) scene, IN(LightShape) s, vec3 position, vec2 u, float time_s) {
  LightSample l;
  uint i = search_above(scene.light_cumulative, s.first, s.count, u.x);
  float below = i > s.first ? scene.light_cumulative.at[i - 1u] : 0.0f;
  u.x = clamp((u.x - below) / max(scene.light_cumulative.at[i] - below, 1e-20f), 0.0f, 0.999999f);
  float root = sqrt(u.x);
  uint word = 2u * (s.first_triangle + i - s.first);
  Surface surface = surface_at(scene, scene.light_triangles.at[word], scene.light_triangles.at[word + 1u], root * (1.0f - u.y), root * u.y, time_s);
  IN(MaterialRecord) record = scene.materials.at[surface.material];
  MaterialPoint m = load_material(scene, record, surface);
  vec3 way = surface.position - position;
  float distance_squared = max(dot(way, way), 1e-20f);
  l.distance_m = sqrt(distance_squared);
  l.direction = way / l.distance_m;
  l.pdf = max_component(band_of(record.emission)) / s.total * distance_squared /
          max(abs(dot(l.direction, surface.geometric_normal)), 1e-9f);
  l.irradiance = m.emission / l.pdf;
  if ((features & feature_cutouts) != 0u) l.irradiance *= coverage(scene, record, surface.place, surface.color.a);
  l.light_group = record.light_group;
  l.distance_m -= surface.coordinate_size * (1.0f / 131072.0f);
  return l;
}

/// Density of sample_mesh per solid angle for a surface met at distance t with this cosine.
float mesh_pdf(IN(MaterialRecord) record, IN(LightShape) s, float t, float cosine) {
  return max_component(band_of(record.emission)) / s.total * t * t / max(abs(cosine), 1e-9f);
}

// Cumulative tables of an environment map: its rows, then each row's columns.
float map_pdf(IN(SceneAddresses) scene, IN(LightShape) s, vec2 uv) {
  uint x = min(uint(fract(uv.x) * float(s.columns)), s.columns - 1u), y = min(uint(uv.y * float(s.count)), s.count - 1u);
  uint row = s.first + y, cell = s.first + s.count + y * s.columns + x;
  float p = scene.light_cumulative.at[row] - (y > 0u ? scene.light_cumulative.at[row - 1u] : 0.0f);
  p *= scene.light_cumulative.at[cell] - (x > 0u ? scene.light_cumulative.at[cell - 1u] : 0.0f);
  return p * float(s.columns * s.count) / (2.0f * pi * pi * max(sin(uv.y * pi), 1e-6f));
}

Spectrum map_radiance(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec2 uv) {
  return band_of(light.intensity) * light_texel(scene, s.texture, vec2(uv.x, clamp(uv.y, s.half_texel, 1.0f - s.half_texel)));
}

LightSample sample_map(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec2 u) {
  LightSample l;
  uint row = search_above(scene.light_cumulative, s.first, s.count, u.y), y = row - s.first;
  float below = y > 0u ? scene.light_cumulative.at[row - 1u] : 0.0f;
  float v = clamp((u.y - below) / max(scene.light_cumulative.at[row] - below, 1e-20f), 0.0f, 0.9999f);
  uint begin = s.first + s.count + y * s.columns, cell = search_above(scene.light_cumulative, begin, s.columns, u.x), x = cell - begin;
  below = x > 0u ? scene.light_cumulative.at[cell - 1u] : 0.0f;
  float h = clamp((u.x - below) / max(scene.light_cumulative.at[cell] - below, 1e-20f), 0.0f, 0.9999f);
  vec2 uv = vec2((float(x) + h) / float(s.columns), (float(y) + v) / float(s.count));
  l.direction = from_light_frame(s, sphere_direction(uv));
  l.distance_m = infinite_m;
  l.pdf = map_pdf(scene, s, uv);
  l.irradiance = l.pdf > 0.0f ? map_radiance(scene, light, s, uv) / l.pdf : Spectrum(0.0f);
  return l;
}

LightSample sample_light(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 position, vec2 u, float time_s) {
  if (is_flat(light.kind)) return sample_flat(scene, light, s, position, u);
  if (light.kind == light_mesh) return sample_mesh(scene, s, position, u, time_s);
  if (light.kind == light_map) return sample_map(scene, light, s, u);
  if (light.kind == light_directional) return sample_directional(scene, light, s, position, u);
  if (light.kind == light_point && s.radius_m > 0.0f) return sample_sphere(light, s, position, u);
  LightSample l;
  vec3 way = light.position - position;
  float distance_squared = max(dot(way, way), 1e-12f);
  l.distance_m = sqrt(distance_squared);
  l.direction = way / l.distance_m;
  l.pdf = 0.0f;
  // A projector's depth of focus needs the way itself, the others its direction.
  vec3 away = light.kind == light_projector ? -way : -l.direction;
  l.irradiance = profile(scene, light, s, away, u) * band_of(light.intensity) / distance_squared;
  if (s.range_m > 0.0f) {
    float share = distance_squared / (s.range_m * s.range_m);
    l.irradiance *= max(0.0f, 1.0f - share * share);
  }
  return l;
}

ShapeHit meet_flat(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 origin, vec3 direction) {
  ShapeHit hit = ShapeHit(false, 0.0f, Spectrum(0.0f), 0.0f);
  float cosine = -dot(direction, s.axis_z), height = dot(origin - light.position, s.axis_z);
  hit.t = height / cosine;
  vec3 p = to_light_frame(s, origin + direction * hit.t - light.position);
  bool inside = light.kind == light_disk ? dot(xy(p), xy(p)) <= s.radius_m * s.radius_m : abs(p.x) <= s.half_size.x && abs(p.y) <= s.half_size.y;
  hit.found = cosine > 0.0f && height > 0.0f && inside;
  hit.pdf = hit.t * hit.t / (cosine * flat_area(light, s));
  if (hit.found) hit.radiance = flat_radiance(scene, light, s, xy(p));
  return hit;
}

ShapeHit meet_sphere(IN(LightRecord) light, IN(LightShape) s, vec3 origin, vec3 direction) {
  ShapeHit hit = ShapeHit(false, 0.0f, Spectrum(0.0f), 0.0f);
  vec3 way = light.position - origin;
  float distance_squared = dot(way, way), along = dot(way, direction);
  vec3 miss_by = way - direction * along;
  float half_chord = s.radius_m * s.radius_m - dot(miss_by, miss_by), cap = sphere_cap(s.radius_m, distance_squared);
  if (along <= 0.0f || half_chord < 0.0f || cap == 0.0f) return hit;
  hit.found = true;
  hit.t = along - sqrt(half_chord);
  hit.pdf = 1.0f / (2.0f * pi * cap);
  hit.radiance = band_of(light.intensity) / (pi * s.radius_m * s.radius_m);
  return hit;
}

/// Where the ray meets the light's shape; directional lights lie beyond everything.
ShapeHit meet_light(IN(SceneAddresses) scene, IN(LightRecord) light, IN(LightShape) s, vec3 origin, vec3 direction) {
  if (is_flat(light.kind)) return meet_flat(scene, light, s, origin, direction);
  if (light.kind == light_point) return meet_sphere(light, s, origin, direction);
  ShapeHit hit = ShapeHit(false, infinite_m, Spectrum(0.0f), 0.0f);
  if (light.kind == light_map) {
    vec2 uv = sphere_uv(to_light_frame(s, direction));
    hit.found = true;
    hit.pdf = map_pdf(scene, s, uv);
    hit.radiance = map_radiance(scene, light, s, uv);
    return hit;
  }
  vec3 off = cross(direction, s.axis_z);  // its length resolves small discs, which a cosine does not
  hit.found = dot(direction, s.axis_z) < 0.0f && dot(off, off) <= s.one_minus_cos * (2.0f - s.one_minus_cos);
  hit.pdf = 1.0f / (2.0f * pi * s.one_minus_cos);
  if (hit.found) hit.radiance = disc_radiance(light, s) * tile(scene, light, s, origin);
  return hit;
}

/// Power heuristic (Veach 1997, 9.2.4): the weight of the technique with density p against the one with density q.
float mis_weight(float p, float q) {
  float r = q / p;
  return 1.0f / (1.0f + r * r);
}
#endif
