// SPDX-License-Identifier: Apache-2.0
// The refracted path of light through smooth glass, from where it is asked for to a light without extent: manifold next-event estimation (Hanika, Droske, Fascione,
// "Manifold Next Event Estimation", 2015) by shooting. A trial follows one direction through all the glass that it meets, by Snell's law, with its
// differential; where it misses the light, the differential says how to turn it (Newton's method, steps halved where they do not help). The first trial
// goes straight at the light. The determinant that Newton's method ends with is what the pencil's cross section does to the light.
// Other trials begin on the far side of the glass's middle, where a lens beyond its focus turns light over, and at its rims. Of several paths one is
// taken, with a chance by what it brings. No path is found that has a reflection.
#include "lib/refraction.glsl"

struct Bend {
  vec3 from, target;  // target: the light's position, or the direction towards it
  bool directional;
  vec3 middle, radii;  // of the glass
  float share;         // of what is found: 1 over the chance of having looked
  vec3 direction;      // of this trial, where the light is asked for
  Differential spread;
  Spectrum gain;       // of this trial
  float length_m;
  uint segments, seed_segments;
  uint surfaces;       // of this trial; 0: still in the open
  uint open;           // of this seed's last trial that ended in the open
  vec3 best;           // direction
  float error;         // of it: metres or radians beside the light; negative: there is none yet
  vec2 step;           // from it, radians
  float scale;
  uint seed, ways;
  vec3 way_0, way_1, way_2;  // their directions
  float total;               // of what they bring
  float random;
  // Of the last segment alone: it completed a path that the caller must keep.
  bool taken;
  vec3 taken_direction, lit;  // as bend_direction, bend_lit
  Spectrum taken_gain;
};

const uint bend_goes_on = 0u, bend_ends = 1u;
const uint bend_seeds = 4u;  // the straight path is the first
const float bend_most_radians = 0.3f, bend_least_scale = 0.1f, bend_tolerance = 3e-5f, bend_same_way = 2e-4f;
const float bend_last_step = 1e-3f;  // in radii of the glass, as seen from where the light is asked for
const float bend_single = 1.1f;  // light that is hardly focused came on one path

Ray begin_trial(INOUT(Bend) b) {
  Frame f = frame_around(b.direction);
  b.spread = Differential(vec3(0.0f), vec3(0.0f), f.tangent, f.bitangent);
  b.gain = Spectrum(1.0f);
  b.length_m = 0.0f;
  b.surfaces = 0u;
  return Ray(b.from, 0.0f, b.direction, uintBitsToFloat(0x7f800000u));
}

/// A search whose first trial is the shadow ray.
Bend begin_bend(IN(Ray) shadow, vec3 target, bool directional, IN(GlassBox) box, float random) {
  Bend b;
  b.from = shadow.origin;
  b.target = target;
  b.directional = directional;
  b.middle = 0.5f * (box.min + box.max);
  b.radii = 0.5f * (box.max - box.min);
  b.share = 1.0f;
  b.direction = b.best = shadow.direction;
  b.segments = b.seed_segments = b.seed = b.ways = b.open = 0u;
  b.error = -1.0f;
  b.step = vec2(0.0f);
  b.scale = 1.0f;
  b.way_0 = b.way_1 = b.way_2 = b.taken_direction = b.lit = vec3(0.0f);
  b.taken_gain = Spectrum(0.0f);
  b.total = 0.0f;
  b.random = random;
  b.taken = false;
  begin_trial(b);
  return b;
}

/// Begins anew elsewhere in the glass.
uint next_seed(INOUT(Bend) b, INOUT(Ray) ray, bool enough) {
  ++b.seed;
  uint seeds = b.share == 1.0f ? bend_seeds : 2u;
  if (enough || b.seed >= seeds || b.ways == 3u || b.segments >= bend_segments) return bend_ends;
  vec3 straight = b.directional ? b.target : normalize(b.target - b.from);
  vec3 beside = b.from + straight * dot(b.middle - b.from, straight) - b.middle;
  float size = length(beside);
  if (size > 1e-6f * length(b.radii)) beside /= size;
  else beside = frame_around(straight).tangent;
  float radius = 1.0f / length(beside / b.radii), part = b.seed == 1u ? -0.6f : b.seed == 2u ? -0.85f : 0.85f;
  b.direction = b.best = normalize(b.middle + beside * (part * radius) - b.from);
  b.error = -1.0f;
  b.scale = 1.0f;
  b.step = vec2(0.0f);
  b.seed_segments = b.open = 0u;
  ray = begin_trial(b);
  return bend_goes_on;
}

vec3 turned(vec3 direction, vec2 step) {
  Frame f = frame_around(direction);
  return normalize(direction + f.tangent * step.x + f.bitangent * step.y);
}

/// A step from the best direction, or half of the last one.
uint try_next(INOUT(Bend) b, INOUT(Ray) ray) {
  if (b.error < 0.0f || b.scale < bend_least_scale || b.seed_segments >= bend_seed_segments) return next_seed(b, ray, false);
  b.direction = turned(b.best, b.step * b.scale);
  b.scale *= 0.5f;
  ray = begin_trial(b);
  return bend_goes_on;
}

bool is_way(IN(Bend) b, uint way, vec3 known, vec3 direction) { return b.ways > way && length(known - direction) < bend_same_way; }

/// The trial reaches the light: each path is counted once.
void take_way(INOUT(Bend) b, vec3 direction, float determinant, float reach_m) {
  bool known = is_way(b, 0u, b.way_0, direction) || is_way(b, 1u, b.way_1, direction) || is_way(b, 2u, b.way_2, direction);
  float brings = max_component(b.gain) / determinant;
  if (!known && brings > 0.0f) {
    if (b.ways == 0u) b.way_0 = direction;
    else if (b.ways == 1u) b.way_1 = direction;
    else b.way_2 = direction;
    ++b.ways;
    b.total += brings;
    float chance = brings / b.total;
    b.taken = b.random < chance;
    b.random = b.taken ? b.random / chance : (b.random - chance) / max(1.0f - chance, 1e-6f);
    if (!b.taken) return;
    b.taken_direction = direction;
    b.taken_gain = b.gain * (reach_m * reach_m / max_component(b.gain));
  }
}

/// How a trial passes the light, were it in the open from here on.
struct Aim {
  float error, determinant;  // metres or radians beside the light; of the error's derivative
  vec2 step;                 // Newton's, radians
  bool reaches;
};

/// What is left to a last step is second order in that: it needs no trial of its own.
Aim aim_of(IN(Bend) b, IN(Ray) ray, float to_light) {
  Frame f = frame_around(ray.direction);
  vec3 miss_by = b.directional ? ray.direction - b.target : ray.origin + ray.direction * to_light - b.target;
  vec3 by_u = b.directional ? b.spread.direction_u : b.spread.position_u + b.spread.direction_u * to_light;
  vec3 by_v = b.directional ? b.spread.direction_v : b.spread.position_v + b.spread.direction_v * to_light;
  vec2 e = vec2(dot(f.tangent, miss_by), dot(f.bitangent, miss_by));
  vec2 u = vec2(dot(f.tangent, by_u), dot(f.bitangent, by_u)), v = vec2(dot(f.tangent, by_v), dot(f.bitangent, by_v));
  Aim aim;
  aim.determinant = u.x * v.y - v.x * u.y;
  aim.error = length(miss_by);
  aim.step = vec2(v.x * e.y - v.y * e.x, u.y * e.x - u.x * e.y) / (aim.determinant == 0.0f ? 1e-30f : aim.determinant);
  float size = length(b.radii);
  aim.reaches = aim.error < bend_tolerance * (b.directional ? 1.0f : b.length_m + to_light) ||
                length(aim.step) < bend_last_step * size / max(length(b.middle - b.from), size);
  return aim;
}

/// Newton's method goes on from the best trial.
uint improve(INOUT(Bend) b, INOUT(Ray) ray, IN(Aim) aim) {
  if (b.error < 0.0f || aim.error < b.error) {
    b.best = b.direction;
    b.error = aim.error;
    b.scale = 1.0f;
    b.step = aim.step * min(1.0f, bend_most_radians / max(length(aim.step), 1e-30f));
  }
  return try_next(b, ray);
}

/// The trial is in the open. `to_light`: metres to where it passes the light.
uint judge_trial(INOUT(Bend) b, INOUT(Ray) ray, float to_light, bool blocked) {
  if (b.surfaces == 0u || to_light <= 0.0f) return try_next(b, ray);
  Aim aim = aim_of(b, ray, to_light);
  if (!blocked) b.open = b.surfaces;
  if (!aim.reaches) return improve(b, ray, aim);
  if (blocked || aim.determinant == 0.0f) return next_seed(b, ray, false);
  if (push.has_medium != 0u) b.gain *= medium_transmittance(push.scene.at[0].medium.at[0], ray.origin, ray.direction, 0.0f, to_light);
  float whole_m = b.length_m + to_light;
  vec3 arriving = normalize(ray.direction + b.spread.direction_u * aim.step.x + b.spread.direction_v * aim.step.y);
  b.lit = b.directional ? ray.origin + b.spread.position_u * aim.step.x + b.spread.position_v * aim.step.y : b.target - arriving * whole_m;
  float reach_m = b.directional ? 1.0f : whole_m;  // irradiance at `lit` is intensity over its square
  take_way(b, turned(b.direction, aim.step), abs(aim.determinant), reach_m);
  return next_seed(b, ray, reach_m * reach_m < bend_single * abs(aim.determinant));
}

/// Through a boundary of a body; false: reflected back totally.
bool refract_at(INOUT(Bend) b, INOUT(Ray) ray, IN(MetSurface) met, IN(Surface) s, IN(MaterialPoint) m, vec3 side, float time_s) {
  IN(SceneAddresses) scene = push.scene.at[0];
  bool front = dot(s.geometric_normal, ray.direction) <= 0.0f;
  NormalField field = normal_field(scene, met.instance, met.primitive, met.u, met.v, time_s, side);
  float flip = front ? 1.0f : -1.0f, eta = front ? 1.0f / m.ior : m.ior, cos_t;
  vec3 n = field.normal * flip;
  float cos_i = min(-dot(ray.direction, n), 1.0f);
  if (cos_i <= 0.0f) return false;
  float reflectance = fresnel_dielectric(cos_i, eta, cos_t) * m.specular;
  if (cos_t <= 0.0f) return false;
  carry(b.spread, met.t, ray.direction, s.geometric_normal);
  b.spread.direction_u = refracted_change(b.spread.direction_u, normal_change(field, b.spread.position_u) * flip, ray.direction, n, cos_i, cos_t, eta);
  b.spread.direction_v = refracted_change(b.spread.direction_v, normal_change(field, b.spread.position_v) * flip, ray.direction, n, cos_i, cos_t, eta);
  // A pencil's solid angle is n^2 times what it would be in the open (Veach 1997, 5.2).
  b.gain *= m.base * ((1.0f - m.metallic) * m.transmission * (1.0f - reflectance) * eta * eta);
  Film film = film_of(m.iridescence, m.iridescence_ior, m.film_nm);
  if (wears_film(film)) b.gain *= (Spectrum(1.0f) - under_film(film, eta, m.specular, reflectance, front ? cos_i : cos_t)) / max(1.0f - reflectance, 1e-6f);
  if ((features & feature_materials) != 0u && !front) b.gain *= band_exp(m.attenuation * -met.t);
  if (push.has_medium != 0u && front) b.gain *= medium_transmittance(scene.medium.at[0], ray.origin, ray.direction, 0.0f, met.t);
  ray.direction = normalize(refracted(ray.direction, n, cos_i, cos_t, eta));
  ray.origin = offset_origin(s.position, s.coordinate_size, front ? -s.geometric_normal : s.geometric_normal);
  return true;
}

/// How much of a surface is there (cutout_search). Not asked of `features`: plain kernels on the host leave all other cutouts to the tracer.
float share_there(IN(SceneAddresses) scene, IN(Surface) s) { return coverage(scene, scene.materials.at[s.material], s.place, s.color.a); }

/// What a surface lets through straight: all where it is not there.
Spectrum straight_past(IN(MaterialPoint) m, float cosine, float there) {
  Spectrum through = straight_transmittance(m, cosine);
  return there == 1.0f ? through : through * there + Spectrum(1.0f - there);
}

/// Goes on where the last segment ended: nowhere, or at a surface.
uint follow_bend(INOUT(Bend) b, INOUT(Ray) ray, bool hit, IN(MetSurface) met, float time_s) {
  ++b.segments;
  ++b.seed_segments;
  b.taken = false;
  float to_light = b.directional ? uintBitsToFloat(0x7f7fffffu) : dot(b.target - ray.origin, ray.direction);
  if (!hit || met.t > to_light) return judge_trial(b, ray, to_light, false);
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, met.instance, met.primitive, met.u, met.v, time_s);
  vec3 side = s.shading_normal;
  MaterialPoint m = load_material(scene, scene.materials.at[s.material], s);
  float there = share_there(scene, s);
  Spectrum straight = straight_past(m, abs(dot(s.geometric_normal, ray.direction)), there);
  if (max_component(straight) == 0.0f && !bends_light(m)) return b.surfaces == 0u ? try_next(b, ray) : judge_trial(b, ray, to_light, true);
  if (b.surfaces >= push.surfaces) return try_next(b, ray);
  if (bends_light(m)) {
    if (!refract_at(b, ray, met, s, m, side, time_s)) return try_next(b, ray);
    b.gain *= there;
  } else {
    carry(b.spread, met.t, ray.direction, s.geometric_normal);
    b.gain *= straight;
    if (push.has_medium != 0u) b.gain *= medium_transmittance(scene.medium.at[0], ray.origin, ray.direction, 0.0f, met.t);
    ray.origin = offset_origin(s.position, s.coordinate_size, dot(s.geometric_normal, ray.direction) <= 0.0f ? -s.geometric_normal : s.geometric_normal);
  }
  b.length_m += met.t;
  ++b.surfaces;
  if (b.surfaces != b.open) return bend_goes_on;
  // Newton's method needs no more of most trials, so that the last segment is traced for those alone that reach the light.
  to_light = b.directional ? to_light : dot(b.target - ray.origin, ray.direction);
  Aim aim = aim_of(b, ray, to_light);
  return to_light > 0.0f && !aim.reaches ? improve(b, ray, aim) : bend_goes_on;
}

/// Whether a shadow ray that met this surface goes on.
bool passes_light(IN(MetSurface) met, float time_s) {
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, met.instance, met.primitive, met.u, met.v, time_s);
  MaterialPoint m = load_material(scene, scene.materials.at[s.material], s);
  return bends_light(m) || max_component(straight_past(m, abs(dot(s.geometric_normal, s.shading_normal)), share_there(scene, s))) > 0.0f;
}

/// Looks beside the straight path, which meets no glass: `share` is 1 over the chance of looking.
uint look_beside(INOUT(Bend) b, INOUT(Ray) ray, float share) {
  b.share = max(share, 1.000001f);
  return next_seed(b, ray, false);
}
