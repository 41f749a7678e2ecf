// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`, light between surfaces at a pixel: what arrives from all sides, of the cells about it, and what lobes get along rays
// through the depth image.
const int mirror_rays = 32;           // of an imager's pixel or, under supersampling, more
const float weak_lobes = 0.2f;        // lobes that reflect no more get half of the rays
const float mirror_reach_m = 1.8f;    // rays that have come so far see the room
const float golden_turn = 0.618034f;  // between facets

/// What all rays of a pixel's lobes share: in the left camera, but for `wo`, which is in the frame.
struct Mirror {
  SeenImage image;
  uint environment, rays, own;  // the place among the samples of an imager's pixel
  vec3 here, wo;
  Frame frame;
  float alpha, metal, metallic, layer, eta;
  float first_step_m, growth;
};

struct MirrorRay {
  vec3 direction;
  float weight;
  float at_m, before_m;  // along it: of this step and the last
  bool meets;
};

Mirror mirror_of(IN(GbufferSurface) s, IN(GbufferPlace) p, uint rays) {
  IN(GbufferCamera) camera = push.record.at[0].cameras[0];
  MaterialPoint material = material_at(s);
  uint n = push.record.at[0].supersampling;
  Mirror m;
  m.image = seen_image(p.environment);
  m.environment = p.environment;
  m.rays = rays;
  m.own = p.row % n * n + p.column % n;
  m.here = in_camera(camera, s.position - camera.view.origin);
  m.frame = frame_around(in_camera(camera, s.normal));
  m.wo = to_local(m.frame, in_camera(camera, s.to_camera));
  m.wo.z = max(m.wo.z, 1e-3f);
  m.alpha = material.roughness * material.roughness;
  m.metallic = material.metallic;
  m.metal = material.metallic * max_component(material.base);
  m.layer = (1.0f - material.metallic) * mix(material.coat, 1.0f, material.transmission);
  m.eta = 1.0f / material.ior;
  m.first_step_m = 1.5f * float(n) / (camera.focal.x * s.inverse_depth);
  m.growth = pow(max(mirror_reach_m / m.first_step_m, 4.0f), 1.0f / float(gbuffer_mirror_steps - 1u));
  return m;
}

/// By a facet that the camera sees, weighed by the BSDF. The samples of an imager's pixel look along different rays.
MirrorRay mirror_ray(IN(Mirror) m, uint k) {
  uint samples = push.record.at[0].supersampling * push.record.at[0].supersampling, number = k * samples + m.own;
  vec3 h = sample_visible_normal(m.wo, m.alpha, vec2(fract(float(number) * golden_turn), (float(number) + 0.5f) / float(m.rays * samples)));
  vec3 wi = reflect(-m.wo, h);
  float cosine = max(wi.z, 1e-6f);
  MirrorRay r;
  r.direction = to_world(m.frame, wi);
  r.weight = plain_fresnel(m.metal, m.metallic, m.layer, m.eta, dot(m.wo, h)) * ggx_visibility(m.wo.z, cosine, max(m.alpha, mirror_alpha)) * cosine;
  r.weight = wi.z > 0.0f ? r.weight : 0.0f;
  r.at_m = m.first_step_m;
  r.before_m = 0.0f;
  r.meets = false;
  return r;
}

vec2 pixel_along(IN(Mirror) m, vec3 direction, float at_m) {
  vec3 q = m.here + at_m * direction;
  return m.image.centre + m.image.focal * xy(q) * (1.0f / max(q.z, 1e-3f));
}

/// 1/m of what is seen where a ray is.
float inverse_along(IN(Mirror) m, IN(MirrorRay) r, float at_m, bool past_border) {
  return met_in(m.image, pixel_along(m, r.direction, at_m), past_border).inverse_depth;
}

/// A step, up to what a ray meets, which is as thick as the step is long.
void march(IN(Mirror) m, bool past_border, INOUT(MirrorRay) r) {
  float z = m.here.z + r.at_m * r.direction.z, inverse = inverse_along(m, r, r.at_m, past_border);
  bool meets = z > 1e-3f && z * inverse > 1.0f && (z - max(0.1f, 2.0f * r.at_m)) * inverse < 1.0f, goes_on = !(r.meets || meets);
  r.before_m = goes_on ? r.at_m : r.before_m;
  r.at_m = goes_on ? r.at_m * m.growth : r.at_m;
  r.meets = r.meets || meets;
}

/// Halves the way on which a ray crosses what is seen.
void halve(IN(Mirror) m, bool past_border, INOUT(MirrorRay) r) {
  float middle = 0.5f * (r.before_m + r.at_m);
  bool crossed = (m.here.z + middle * r.direction.z) * inverse_along(m, r, middle, past_border) > 1.0f;
  r.at_m = crossed ? middle : r.at_m;
  r.before_m = crossed ? r.before_m : middle;
}

/// What a cell sends, of the room as a share and of the projector, and its weight about a place of this 1/m.
vec3 weighed_sent(IN(NearCell) c, float inverse) {
  vec4 sent = push.record.at[0].cells.at[c.cell].sent;
  float weight = sent.x > 0.0f ? c.near * (abs(sent.x - inverse) < 0.15f * inverse ? 1.0f : 1e-3f) : 0.0f;
  return weight * vec3(sent.y, sent.z, 1.0f);
}

/// The light where a ray crosses what is seen: of the cells about it, those whose depth is about that of its own.
vec2 met_light(IN(Mirror) m, IN(MirrorRay) r) {
  Met met = met_in(m.image, pixel_along(m, r.direction, r.at_m), false);
  float inverse = push.record.at[0].cells.at[met.cell].sent.x;
  vec3 sum = weighed_sent(near_cell(m.environment, met.pixel, 0), inverse) + weighed_sent(near_cell(m.environment, met.pixel, 1), inverse);
  sum += weighed_sent(near_cell(m.environment, met.pixel, 2), inverse) + weighed_sent(near_cell(m.environment, met.pixel, 3), inverse);
  float scale = 1.0f / max(sum.z, 1e-12f);
  bool found = r.meets && sum.z > 0.0f;
  return vec2(found ? sum.x * scale : 1.0f, found ? sum.y * scale : 0.0f);
}

/// What lobes get of the room, as a share, and of the projector.
vec2 mirrored_light(IN(Mirror) m) {
  vec2 sum = vec2(0.0f);
  float weights = 0.0f;
  for (uint k = 0u; k < m.rays; ++k) {
    MirrorRay r = mirror_ray(m, k);
    for (uint n = 0u; n < gbuffer_mirror_steps && !r.meets && r.weight > 0.0f; ++n) march(m, is_past_border(m.image, pixel_along(m, r.direction, r.at_m)), r);
    for (uint n = 0u; n < gbuffer_mirror_halvings && r.meets; ++n) halve(m, true, r);
    sum += r.weight * (r.meets ? met_light(m, r) : vec2(1.0f, 0.0f));
    weights += r.weight;
  }
  return weights > 0.0f ? sum / weights : vec2(1.0f, 0.0f);
}

uint mirror_rays_of(float lobes) { return uint(lobes > weak_lobes ? mirror_rays : mirror_rays / 2) / push.record.at[0].supersampling; }

/// A pixel's light: what arrives there from all sides, and by lobes.
void write_bounce(uint i, IN(GbufferPlace) p, vec2 arriving, vec2 mirrored) {
  float ambient = push.record.at[0].ambient.at[p.environment], direct = push.record.at[0].laser.at[i], indirect = 0.0f, room = ambient;
  if (push.record.at[0].cameras[p.camera].inverse_depth.at[p.pixel] > 0.0f) {
    float matt = push.record.at[0].matt.at[i], lobes = push.record.at[0].lobes.at[i];
    room *= matt * arriving.x + lobes * mirrored.x;
    indirect = matt * arriving.y + lobes * mirrored.y;
  }
  push.record.at[0].room.at[i] = room;
  push.record.at[0].laser.at[i] = direct + indirect;
  write_output(output_radiance + 1u + group_projector_direct, p, push.record.at[0].laser_as_one != 0u ? direct + indirect : direct);
  write_output(output_radiance + 1u + group_projector_indirect, p, indirect);
}

bool has_lobes(uint i, IN(GbufferPlace) p) {
  return push.record.at[0].lobes.at[i] > 0.0f && push.record.at[0].cameras[p.camera].inverse_depth.at[p.pixel] > 0.0f;
}

void bounce_pixel(uint i, IN(GbufferPlace) p) {
  float inverse = push.record.at[0].cameras[p.camera].inverse_depth.at[p.pixel], lobes = push.record.at[0].lobes.at[i];
  vec2 arriving = vec2(0.0f), mirrored = vec2(0.0f);
  if (inverse > 0.0f) {
    arriving = arriving_at(p.environment, vec2(left_column(p, inverse), float(p.row)), inverse);
    if (step == gbuffer_lobes) mirrored = mirrored_light(mirror_of(surface_at_pixel(p), p, mirror_rays_of(lobes)));
  }
  write_bounce(i, p, arriving, mirrored);
}
