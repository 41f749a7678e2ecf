// SPDX-License-Identifier: Apache-2.0
// Stage `follow`: beams of light go from a light without extent through bodies of smooth glass to where they land, by Snell's law, with their differentials:
// photon differentials (Schjøth, Frisvad, Erleben, Sporring, "Photon Differentials", GRAPHITE 2007) on a regular grid. The tents that neighbours of the grid
// weigh with add up to one, so that what lands has no noise, and a point knows where in the light's pattern it lies to second order of the grid's step.
#include "lib/splat_table.glsl"
#include "lib/refraction.glsl"

struct Segment {
  bool wanted;
  Ray ray;
  uint beam;
};

uint beam_field(uint i, uint field) { return push.rays_in.at[closest_word(i, field, push.capacity)]; }
float beam_value(uint i, uint field) { return uintBitsToFloat(beam_field(i, field)); }

// --- from the light ---

uint source_of(uint beam) {
  uint low = 0u, high = push.source_count;
  while (low + 1u < high) {
    uint middle = (low + high) / 2u;
    if (beam < push.sources.at[middle].first_beam) high = middle;
    else low = middle;
  }
  return low;
}

/// The beam's ray from its light.
Ray begin_beam(uint index) {
  uint source = source_of(index);
  IN(BeamSource) s = push.sources.at[source];
  uint row = (index - s.first_beam) / s.columns, column = index - s.first_beam - row * s.columns;
  vec2 at = s.first + (vec2(float(column), float(row)) + push.jitter) * s.step;
  Beam p;
  p.position_u = p.position_v = p.direction_u = p.direction_v = vec3(0.0f);
  if ((s.flags & source_directional) != 0u) {
    p.position = p.lit = s.origin + s.axis_u * at.x + s.axis_v * at.y;
    p.direction = s.axis;
    p.position_u = p.lit_u = s.axis_u * s.step.x;
    p.position_v = p.lit_v = s.axis_v * s.step.y;
    p.weight = s.step.x * s.step.y;
  } else {
    vec3 way = s.axis + s.axis_u * at.x + s.axis_v * at.y;
    float size = length(way);
    p.position = s.origin;
    p.direction = p.lit = way / size;  // until it has landed
    p.direction_u = p.lit_u = (s.axis_u - p.direction * dot(p.direction, s.axis_u)) * (s.step.x / size);
    p.direction_v = p.lit_v = (s.axis_v - p.direction * dot(p.direction, s.axis_v)) * (s.step.y / size);
    p.weight = s.step.x * s.step.y / (size * size * size);
  }
  p.gain = vec3(1.0f);
  p.length_m = 0.0f;
  p.source = source;
  p.state = 0u;
  p.level = splat_least_level;
  p.light = s.light;
  p.environment = s.environment;
  push.beams.at[index] = p;
  return Ray(p.position, 0.0f, p.direction, uintBitsToFloat(0x7f800000u));
}

// --- through surfaces ---

const float most_steps = 8.0f;            // of the grid, were there no glass: half of the longest section
const float beam_least = 1.0f / 64.0f;  // of the light that would be there without glass

/// Follows the beam's place in its own source's grid, whatever other sources there are.
float beam_chance(IN(Beam) p, uint index, uint purpose) {
  IN(BeamSource) s = push.sources.at[p.source];
  uint surfaces = p.state & beam_surfaces_mask;
  return unit_float(hash((index - s.first_beam) ^ hash((4u * surfaces + purpose) ^ hash(push.key ^ hash(s.key)))));
}

vec3 colour_of(Spectrum s) {
#if KUAFU_CHANNELS == 1
  return vec3(s);
#else
  return s;
#endif
}

Differential spread_of(IN(Beam) p) { return Differential(p.position_u, p.position_v, p.direction_u, p.direction_v); }

void set_spread(INOUT(Beam) p, IN(Differential) d) {
  p.position_u = d.position_u;
  p.position_v = d.position_v;
  p.direction_u = d.direction_u;
  p.direction_v = d.direction_v;
}

vec3 reflected_change(vec3 change, vec3 normal_change, vec3 direction, vec3 n) {
  return change - 2.0f * ((dot(change, n) + dot(direction, normal_change)) * n + dot(direction, n) * normal_change);
}

/// At a boundary of a body. Light that no surface turns back in part goes on refracted; of the other a chance says where it goes. False: nothing is left.
bool cross_boundary(INOUT(Beam) p, uint index, IN(MetSurface) met, IN(Surface) s, IN(MaterialPoint) m, vec3 side, OUT(vec3) outward) {
  bool front = dot(s.geometric_normal, p.direction) <= 0.0f;
  NormalField field = normal_field(push.scene.at[0], met.instance, met.primitive, met.u, met.v, 0.0f, side);
  float flip = front ? 1.0f : -1.0f, eta = front ? 1.0f / m.ior : m.ior, cos_t;
  vec3 n = field.normal * flip;
  float cos_i = min(-dot(p.direction, n), 1.0f);
  outward = front ? s.geometric_normal : -s.geometric_normal;
  if (cos_i <= 0.0f) return false;
  Spectrum reflectance = Spectrum(fresnel_dielectric(cos_i, eta, cos_t) * m.specular);
  bool total = cos_t <= 0.0f;
  ThinFilm film = thin_film_of(m.iridescence, m.iridescence_ior, m.thin_film_nm);
  if (wears_thin_film(film) && !total) reflectance = under_thin_film(film, eta, m.specular, channel_of(reflectance, 0u), front ? cos_i : cos_t);
  float mean = max_component(reflectance), share = (1.0f - m.metallic) * m.transmission;
  bool turns = total;
  float weight = 1.0f;
  if (!total && (push.sources.at[p.source].flags & source_turned) != 0u) {
    float chance = (p.state & beam_turned) != 0u ? mean : clamp(mean, 0.25f, 0.75f);
    turns = beam_chance(p, index, 0u) < chance;
    weight = 1.0f / (turns ? chance : 1.0f - chance);
    if (turns) p.state |= beam_turned;
  }
  Differential d = spread_of(p);
  carry(d, met.t, p.direction, s.geometric_normal);
  vec3 bent_u = normal_change(field, d.position_u) * flip, bent_v = normal_change(field, d.position_v) * flip;
  if (turns) {
    d.direction_u = reflected_change(d.direction_u, bent_u, p.direction, n);
    d.direction_v = reflected_change(d.direction_v, bent_v, p.direction, n);
    if (!total) p.gain *= colour_of(reflectance) * weight;
    p.direction = normalize(reflect(p.direction, n));
  } else {
    d.direction_u = refracted_change(d.direction_u, bent_u, p.direction, n, cos_i, cos_t, eta);
    d.direction_v = refracted_change(d.direction_v, bent_v, p.direction, n, cos_i, cos_t, eta);
    p.gain *= colour_of(m.base * (Spectrum(1.0f) - reflectance)) * weight;
    p.direction = normalize(refracted(p.direction, n, cos_i, cos_t, eta));
    outward = -outward;
  }
  p.gain *= share;
  set_spread(p, d);
  return dot(p.direction, outward) > 0.0f && max(p.gain.x, max(p.gain.y, p.gain.z)) > 1e-4f;
}

/// The beam's cross section at the surface, and what of its light falls on each part of it. A section much longer than wide is made wider, for it is then
/// curved, too: what it is worth stays.
void splat(INOUT(Beam) p, uint index, IN(Surface) s) {
  Frame f = frame_around(p.direction);
  vec2 u = vec2(dot(f.tangent, p.position_u), dot(f.bitangent, p.position_u)), v = vec2(dot(f.tangent, p.position_v), dot(f.bitangent, p.position_v));
  // Its longest direction, of the section (e) and of the grid (g): singular values of the matrix (u, v).
  float angle = 0.5f * atan(2.0f * (u.x * u.y + v.x * v.y), u.x * u.x + v.x * v.x - u.y * u.y - v.y * v.y), least = s.coordinate_size * 1e-6f;
  vec2 e = vec2(cos(angle), sin(angle)), g = vec2(dot(u, e), dot(v, e));
  float determinant = u.x * v.y - v.x * u.y, longest = max(length(g), 1e-30f);
  g /= longest;
  float width = max(abs(determinant) / longest, max(longest * (1.0f / 32.0f), least)), side = determinant < 0.0f ? -1.0f : 1.0f;
  bool directional = (push.sources.at[p.source].flags & source_directional) != 0u;
  float reach_m = directional ? 1.0f : p.length_m;
  // Where neighbours part widely, at rims above all, derivatives reach farther than the light does: no section is larger than some of the grid's own steps.
  float extent = clamp(longest, least, max(least, most_steps * sqrt(p.weight) * reach_m));
  width = min(width, extent);
  float off = max(width, extent * (1.0f / 8.0f));
  vec3 along = f.tangent * e.x + f.bitangent * e.y, across = f.bitangent * e.x - f.tangent * e.y;
  p.position_u = along * (g.x / extent) - across * (side * g.y / width);
  p.position_v = along * (g.y / extent) + across * (side * g.x / width);
  p.direction_u = s.geometric_normal / off;
  p.direction_v = along / extent;
  vec3 half_width = half_width_of(p);
  float most = max(half_width.x, max(half_width.y, half_width.z));
  p.level = max(level_of(max(width, max(0.5f * extent, most * (2.0f / float(splat_most_cells_along - 2u))))), push.sources.at[p.source].least_level);
  p.gain *= p.weight * reach_m * reach_m / (extent * width);
  if (!directional) {
    p.lit = push.sources.at[p.source].origin + p.lit * reach_m;
    p.lit_u *= reach_m;
    p.lit_v *= reach_m;
  }
  p.position = s.position;
  // Where a node's light goes far apart, many cover each point: a few of them, as much brighter, do.
  float brings = max(p.gain.x, max(p.gain.y, p.gain.z)), chance = min(1.0f, brings / beam_least);
  if (beam_chance(p, index, 2u) >= chance || p.level > splat_most_level) return;
  p.gain /= chance;
  p.state |= beam_landed;
}

/// Straight through a sheet, or what is not there.
void pass_straight(INOUT(Beam) p, float t, IN(Surface) s, Spectrum through) {
  Differential d = spread_of(p);
  carry(d, t, p.direction, s.geometric_normal);
  set_spread(p, d);
  p.gain *= colour_of(through);
}

MetSurface met_surface(uint i) {
  return MetSurface(beam_field(i, hit_instance), beam_field(i, hit_primitive), beam_value(i, hit_u), beam_value(i, hit_v), beam_value(i, ray_t_far));
}

/// What becomes of a beam where its ray ended.
Segment follow_beam(uint i) {
  Segment onward = Segment(false, empty_ray(), beam_field(i, ray_id));
  if (beam_field(i, hit_geometry) == miss) return onward;
  uint index = onward.beam;
  Beam p = push.beams.at[index];
  IN(SceneAddresses) scene = push.scene.at[0];
  MetSurface met = met_surface(i);
  Surface s = surface_at(scene, met.instance, met.primitive, met.u, met.v, 0.0f);
  vec3 side = s.shading_normal;
  MaterialPoint m = load_material(scene, scene.materials.at[s.material], s);
  bool bends = bends_light(m), front = dot(s.geometric_normal, p.direction) <= 0.0f;
  if (bends && (p.state & beam_bent) == 0u && met.instance != push.sources.at[p.source].instance) return onward;
  if ((features & feature_materials) != 0u && !front && m.transmission > 0.0f) p.gain *= colour_of(band_exp(m.attenuation * -met.t));
  if ((push.flags & beam_medium) != 0u && (front || !bends)) p.gain *= colour_of(medium_transmittance(scene.medium.at[0], p.position, p.direction, 0.0f, met.t));
  p.length_m += met.t;
  Spectrum straight = bends ? Spectrum(0.0f) : straight_transmittance(m, abs(dot(s.geometric_normal, p.direction)));
  // What lets only a part of the light through has something for it to land on, too: a chance says which it is.
  float through = bends ? (1.0f - m.metallic) * m.transmission : max_component(straight) > 0.0f ? (1.0f - m.metallic) * m.transmission : 0.0f;
  bool passes = through > 0.0f && (through >= 1.0f || beam_chance(p, index, 1u) < through);
  p.gain /= passes ? through : 1.0f - through;
  if (!passes) {
    if ((p.state & beam_bent) == 0u) return onward;
    if ((push.sources.at[p.source].flags & source_turned) != 0u && (p.state & beam_turned) == 0u) return onward;
    Differential d = spread_of(p);
    carry(d, met.t, p.direction, s.geometric_normal);
    set_spread(p, d);
    splat(p, index, s);
    push.beams.at[index] = p;
    return onward;
  }
  if ((p.state & beam_surfaces_mask) >= push.surfaces) return onward;
  vec3 outward = front ? -s.geometric_normal : s.geometric_normal;
  if (bends) {
    if (!cross_boundary(p, index, met, s, m, side, outward)) return onward;
    p.state |= beam_bent;
  } else {
    pass_straight(p, met.t, s, straight);
  }
  ++p.state;
  p.position = offset_origin(s.position, s.coordinate_size, outward);
  push.beams.at[index] = p;
  onward.wanted = true;
  onward.ray = Ray(p.position, 0.0f, p.direction, uintBitsToFloat(0x7f800000u));
  return onward;
}

void queue_beam(IN(Segment) onward, uint i) {
  store_closest_ray(push.rays_out, i, push.capacity, onward.ray, 0.0f, onward.beam);
  if ((push.flags & beam_environments) != 0u) push.environments_out.at[i] = push.beams.at[onward.beam].environment;
}

/// Beam push.first + i goes to place i of the queue.
void send_beam(uint i) {
  uint index = push.first + i;
  queue_beam(Segment(true, begin_beam(index), index), i);
}
