// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`: the pair that two infrared cameras see of surfaces that another renderer gave. What a view lacks is warped from the left
// camera's (stage/gbuffer_warp.glsl). The projector's light comes by one reflection; the room's, and what surfaces send one another, by
// rays through the depth image (stage/gbuffer_bounce.glsl).
uint pixels_per_view() { return push.record.at[0].width * push.record.at[0].height; }
uint pixels_per_camera() { return pixels_per_view() * push.record.at[0].environments; }

/// A pixel of one camera; `pixel` counts in all environments.
struct GbufferPlace {
  uint camera, environment, pixel, row, column;
};

GbufferPlace gbuffer_place(uint i) {
  GbufferPlace p;
  p.camera = i / pixels_per_camera();
  p.pixel = i - p.camera * pixels_per_camera();
  uint line = p.pixel / push.record.at[0].width;
  p.column = p.pixel - line * push.record.at[0].width;
  p.environment = line / push.record.at[0].height;
  p.row = line - p.environment * push.record.at[0].height;
  return p;
}

vec3 pixel_way(IN(ViewRecord) view, float column, float row) { return view.axis_0 + column * view.axis_u + row * view.axis_v; }

bool is_number(float x) { return (floatBitsToUint(x) & 0x7fffffffu) < 0x7f800000u; }

// ---- read ----

void refuse(uint image, uint pixel, uint what) {
  uint environment = pixel / pixels_per_view();
  atomicMin(push.record.at[0].errors.at[environment], (pixel - environment * pixels_per_view()) << gbuffer_error_bits | image << 2u | what);
}

void check_surface(uint image, uint pixel) {
  IN(GbufferCamera) camera = push.record.at[0].cameras[image];
  if ((camera.given & gbuffer_has_normal) != 0u) {
    vec3 n = vec3(camera.normal.at[3u * pixel], camera.normal.at[3u * pixel + 1u], camera.normal.at[3u * pixel + 2u]);
    float length_squared = dot(n, n);
    if (!is_number(length_squared) || length_squared < 0.96f || length_squared > 1.04f) refuse(image, pixel, gbuffer_bad_normal);
  }
  if ((camera.given & gbuffer_has_albedo) != 0u) {
    float albedo = camera.albedo.at[pixel];
    if (!is_number(albedo) || albedo < 0.0f || albedo > 1.0f) refuse(image, pixel, gbuffer_bad_albedo);
  }
  if ((camera.given & gbuffer_has_material) != 0u) {
    uint material = camera.material.at[pixel];
    if (material >= push.record.at[0].materials || (material > 0u && push.record.at[0].material_places.at[material] == 0u))
      refuse(image, pixel, gbuffer_bad_material);
  }
}

/// Image 0 is the left camera's, 1 the right one's, 2 the projector's.
void read_pixel(uint i) {
  uint image = i / pixels_per_camera(), pixel = i - image * pixels_per_camera();
  if (image == 0u) {
    push.record.at[0].between.at[pixel] = push.record.at[0].between.at[pixels_per_camera() + pixel] = 0u;
    push.record.at[0].middles.at[pixel] = push.record.at[0].middles.at[pixels_per_camera() + pixel] = 0u;
  }
  if (image == 1u && (push.record.at[0].cameras[1].given & gbuffer_has_depth) == 0u) return;
  if (image == 2u && push.record.at[0].projector_depth_given == 0u) return;
  float z = image == 2u ? push.record.at[0].projector_depth.at[pixel] : push.record.at[0].cameras[image].depth.at[pixel];
  if (floatBitsToUint(z) == 0x7f800000u) z = 0.0f;  // nothing there, as simulators have it
  if (!is_number(z) || z < 0.0f) refuse(image, pixel, gbuffer_bad_depth);
  if (push.record.at[0].along_rays != 0u) {
    GbufferPlace p = gbuffer_place(pixel);
    z /= length(pixel_way(push.record.at[0].cameras[image & 1u].view, float(p.column), float(p.row)));
  }
  bool found = z > 1e-30f;
  float inverse = found ? 1.0f / z : 0.0f;
  if (image == 2u) push.record.at[0].projector_inverse.at[pixel] = inverse;
  else push.record.at[0].cameras[image].inverse_depth.at[pixel] = inverse;
  if (found && image < 2u) check_surface(image, pixel);
}

// ---- surfaces ----

/// The way across a plane through a pixel and that neighbour of the two whose depth is nearer.
vec3 step_across(IN(GbufferCamera) camera, IN(GbufferPlace) p, float inverse, int along_column, int along_row) {
  int width = int(push.record.at[0].width), stride = along_row * width + along_column;
  int at = along_column != 0 ? int(p.column) : int(p.row), last = along_column != 0 ? width - 1 : int(push.record.at[0].height) - 1;
  float before = at > 0 ? camera.inverse_depth.at[int(p.pixel) - stride] : 0.0f, after = at < last ? camera.inverse_depth.at[int(p.pixel) + stride] : 0.0f;
  bool backward = before > 0.0f && (after == 0.0f || abs(before - inverse) < abs(after - inverse));
  float other = backward ? before : after, side = backward ? -1.0f : 1.0f;
  if (other == 0.0f) return vec3(0.0f);
  vec3 here = pixel_way(camera.view, float(p.column), float(p.row)) / inverse;
  vec3 there = pixel_way(camera.view, float(p.column) + side * float(along_column), float(p.row) + side * float(along_row)) / other;
  return (there - here) * side;
}

/// Unit, in the world, towards the camera.
vec3 surface_normal(IN(GbufferCamera) camera, IN(GbufferPlace) p, float inverse, vec3 to_camera) {
  vec3 n;
  if ((camera.given & gbuffer_has_normal) != 0u) {
    n = camera.axis_x * camera.normal.at[3u * p.pixel] + camera.axis_y * camera.normal.at[3u * p.pixel + 1u] + camera.axis_z * camera.normal.at[3u * p.pixel + 2u];
  } else {
    n = cross(step_across(camera, p, inverse, 1, 0), step_across(camera, p, inverse, 0, 1));
  }
  float length_squared = dot(n, n);
  if (!(length_squared > 1e-20f)) return to_camera;
  n *= inversesqrt(length_squared);
  return dot(n, to_camera) < 0.0f ? -n : n;
}

struct GbufferSurface {
  float inverse_depth;
  vec3 way, position, normal, to_camera;  // way: from the camera, with z = 1 there
  uint material;  // its place in the scene's table
  float albedo;  // below 0: the material's
};

/// Where what a pixel shows was given: the left camera's pixel, for a view that was warped.
GbufferPlace shown_place(IN(GbufferPlace) p) {
  GbufferPlace q = p;
  IN(GbufferCamera) own = push.record.at[0].cameras[p.camera];
  if ((own.given & gbuffer_has_depth) != 0u) return q;
  q.camera = 0u;
  q.column = own.source.at[p.pixel];
  q.pixel = p.pixel - p.column + q.column;
  return q;
}

/// What the pixel shows, which of a view that was warped is what a pixel of the left one shows.
GbufferSurface surface_at_pixel(IN(GbufferPlace) p) {
  GbufferSurface s;
  IN(GbufferCamera) own = push.record.at[0].cameras[p.camera];
  s.inverse_depth = own.inverse_depth.at[p.pixel];
  s.way = pixel_way(own.view, float(p.column), float(p.row));
  s.to_camera = normalize(-s.way);
  s.position = own.view.origin + s.way / max(s.inverse_depth, 1e-20f);
  GbufferPlace q = shown_place(p);
  IN(GbufferCamera) camera = push.record.at[0].cameras[q.camera];
  s.normal = surface_normal(camera, q, camera.inverse_depth.at[q.pixel], s.to_camera);
  uint material = (camera.given & gbuffer_has_material) != 0u ? camera.material.at[q.pixel] : 0u;
  // Where nothing is, and in an image that was refused, it may be any number.
  s.material = material < push.record.at[0].materials ? push.record.at[0].material_places.at[material] : 0u;
  s.albedo = (camera.given & gbuffer_has_albedo) != 0u ? camera.albedo.at[q.pixel] : -1.0f;
  return s;
}

/// The infrared albedo that was measured of a material counts more than an image, which may be a guess.
MaterialPoint material_at(IN(GbufferSurface) s) {
  MaterialPoint m = plain_material(push.record.at[0].scene.at[0].materials.at[s.material]);
  if (s.albedo >= 0.0f && push.record.at[0].measured_albedo.at[s.material] == 0u) m.base = Spectrum(s.albedo);
  return m;
}

// ---- light ----

/// A surface before its BSDF is asked.
struct GbufferVertex {
  bool found, lit;
  MaterialPoint material;
  vec3 wo, wi;  // in the frame of the normal
  float irradiance;
};

// A surface's own shadow: it has to lie so far behind what hides it.
const float behind_share = 0.01f, behind_m = 0.01f;

/// Whether nothing nearer hides it from the projector. What lies beside the image hides nothing.
bool sees_projector(IN(GbufferCamera) camera, IN(GbufferPlace) p, float own) {
  float width = float(push.record.at[0].width), x = float(p.column) - camera.shift_px - camera.projector_px_m * own;
  if (x < -1.0f || x > width) return true;
  uint left = uint(clamp(x, 0.0f, width - 1.0f)), beside = min(left + 1u, push.record.at[0].width - 1u), first = p.pixel - p.column;
  float hiding = min(push.record.at[0].projector_inverse.at[first + left], push.record.at[0].projector_inverse.at[first + beside]);
  return hiding <= own * (1.0f + behind_share + behind_m * hiding);
}

GbufferVertex vertex_at(IN(GbufferPlace) p) {
  GbufferVertex v;
  GbufferSurface s = surface_at_pixel(p);
  v.found = s.inverse_depth > 0.0f;
  v.lit = v.found && sees_projector(push.record.at[0].cameras[p.camera], p, s.inverse_depth);
  v.material = material_at(s);
  Frame frame = frame_around(s.normal);
  v.wo = to_local(frame, s.to_camera);
  v.wo.z = max(v.wo.z, 1e-3f);
  v.wi = vec3(0.0f, 0.0f, 1.0f);
  v.irradiance = 0.0f;
  if (push.record.at[0].has_projector == 0u) return v;
  IN(LightRecord) light = push.record.at[0].scene.at[0].lights.at[0];
  vec3 away = s.position - light.position;
  float distance_squared = max(dot(away, away), 1e-12f);
  v.wi = to_local(frame, away * -inversesqrt(distance_squared));
  if (v.lit && v.wi.z > 0.0f)
    v.irradiance = light.intensity.x * push.record.at[0].power.at[p.environment] *
                   projected_mean(push.record.at[0].pattern, push.record.at[0].scene.at[0].light_shapes.at[0], away) / distance_squared;
  return v;
}

void write_output(uint kind, IN(GbufferPlace) p, float value) {
  IN(OutputRecord) record = push.record.at[0].outputs.at[kind];
  if (record.enabled == 0u) return;
  uint view = p.camera * push.record.at[0].environments + p.environment;
  record.words.at[output_element(record, Pixel(view, p.row, p.column), 1u)] = floatBitsToUint(value);
}

void write_vertex(uint i, IN(GbufferPlace) p, IN(GbufferVertex) v, IN(Reflected) r) {
  float inverse = push.record.at[0].cameras[p.camera].inverse_depth.at[p.pixel];
  push.record.at[0].matt.at[i] = v.found ? r.matt : 0.0f;
  push.record.at[0].lobes.at[i] = v.found ? r.lobes : 0.0f;
  push.record.at[0].laser.at[i] = v.irradiance > 0.0f ? v.irradiance * r.f : 0.0f;
  write_output(output_depth, p, v.found ? 1.0f / inverse : 0.0f);
  write_output(output_projector_visibility, p, v.lit ? 1.0f : 0.0f);
}

void light_pixel(uint i) {
  GbufferPlace p = gbuffer_place(i);
  GbufferVertex v = vertex_at(p);
  write_vertex(i, p, v, reflected(v.material, push.record.at[0].scene.at[0].specular_albedo, v.wo, v.wi));
}
