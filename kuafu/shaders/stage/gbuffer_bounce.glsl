// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`, light between surfaces, as far as the image shows them. Matt surfaces get the room's light past what the depth image has
// about them, and from that what it sends out (Jimenez et al., "Practical Realtime Strategies for Accurate Indirect Occlusion", 2016). Lobes
// look along mirrored rays. All of it is found in the left camera's image, for both cameras: a point that sends light to all sides has one
// radiance, and what two images miss of it differs.
const int horizon_slices = 4, horizon_steps = 10, horizon_sectors = 32;
const float horizon_growth = 2.0f;    // of the steps
const float horizon_reach_m = 3.0f;   // what is farther away hides half of what it would, or less
const float thickness_m = 0.15f;      // of things, along the view
const float steepest_surface = 3.0f;  // a tangent: between steps that part more, the image shows an edge
const int mirror_rays = 32;           // of an imager's pixel or, under supersampling, more
const float weak_lobes = 0.2f;        // lobes that reflect no more get half of the rays
const int mirror_steps = 12;
const float mirror_reach_m = 1.8f;    // rays that have come so far see the room
const float golden_turn = 0.618034f;  // between facets
const float plane_share = 4e-3f;      // of its distance: a point that lies so far from a cell's plane is of its surface by half
const int hidden_steps = 12;          // of a cell, past what hides a point from the left camera
const float hides = 1.05f;            // times a point's 1/m
const float edge_px = 0.2f;           // of what a pixel spans there: what lies so far off a surface's plane is another surface

uint cells_per_view() { return push.record.at[0].cell_columns * push.record.at[0].cell_rows; }

/// The middle pixel of a cell.
GbufferPlace cell_place(uint i) {
  GbufferPlace p;
  p.camera = 0u;
  p.environment = i / cells_per_view();
  uint cell = i - p.environment * cells_per_view(), row = cell / push.record.at[0].cell_columns;
  p.row = min(row * gbuffer_cell_px + gbuffer_cell_px / 2u, push.record.at[0].height - 1u);
  p.column = min((cell - row * push.record.at[0].cell_columns) * gbuffer_cell_px + gbuffer_cell_px / 2u, push.record.at[0].width - 1u);
  p.pixel = (p.environment * push.record.at[0].height + p.row) * push.record.at[0].width + p.column;
  return p;
}

vec3 in_camera(IN(GbufferCamera) camera, vec3 w) { return vec3(dot(camera.axis_x, w), dot(camera.axis_y, w), dot(camera.axis_z, w)); }

void mean_of_cell(uint i) {
  GbufferPlace p = cell_place(i);
  uint first_row = p.row / gbuffer_cell_px * gbuffer_cell_px, first_column = p.column / gbuffer_cell_px * gbuffer_cell_px;
  uint base = p.environment * pixels_per_view();
  float laser = 0.0f, albedo = 0.0f, lobes = 0.0f, count = 0.0f;
  for (uint row = first_row; row < min(first_row + gbuffer_cell_px, push.record.at[0].height); ++row)
    for (uint column = first_column; column < min(first_column + gbuffer_cell_px, push.record.at[0].width); ++column) {
      uint at = base + row * push.record.at[0].width + column;
      laser += push.record.at[0].laser.at[at];
      albedo += push.record.at[0].matt.at[at];
      lobes += push.record.at[0].lobes.at[at];
      count += 1.0f;
    }
  GbufferSurface s = surface_at_pixel(p);
  push.record.at[0].cells.at[i].normal = s.inverse_depth > 0.0f ? in_camera(push.record.at[0].cameras[0], s.normal) : vec3(0.0f, 0.0f, -1.0f);
  push.record.at[0].cells.at[i].inverse_depth = s.inverse_depth;
  push.record.at[0].cells.at[i].laser = laser / count;
  push.record.at[0].cells.at[i].albedo = (albedo + lobes) / count;
  push.record.at[0].cells.at[i].lobes = lobes / count;
}

/// Share of the light on a surface that comes, within a slice, from between the viewer's direction and a horizon at `angle` from it; the
/// normal is tilted by `tilt` in the slice.
float horizon_arc(float angle, float tilt) { return 0.25f * (-cos(2.0f * angle - tilt) + cos(tilt) + 2.0f * angle * sin(tilt)); }

/// acos without a call (Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.46), off by 3e-7 at most.
float angle_of(float cosine) {
  float x = abs(cosine);
  float near = 1.5707963050f + x * (-0.2145988016f + x * (0.0889789874f + x * (-0.0501743046f + x * (0.0308918810f + x * (-0.0170881256f + x * (0.0066700901f - x * 0.0012624911f))))));
  float angle = near * sqrt(max(1.0f - x, 0.0f));
  return cosine < 0.0f ? pi - angle : angle;
}

vec3 seen_position(IN(GbufferCamera) camera, vec2 pixel, float inverse) {
  return vec3((pixel.x - camera.centre.x) / camera.focal.x, (pixel.y - camera.centre.y) / camera.focal.y, 1.0f) / inverse;
}

struct Horizon {
  float room, laser, albedo;  // shares of the light: from the room; from surfaces, times their laser and their albedo
};

/// Where a way through the room meets the image: a pixel, and 1/m of what stands there, which goes on in its plane beyond the border
/// (inverse depth is linear in a plane's image); 0 where nothing is seen.
struct Met {
  vec2 pixel;
  uint cell;
  float inverse_depth;
};

/// 1/m in the cell at (column, row).
float cell_inverse(uint first_cell, int column, int row) {
  return push.record.at[0].cells.at[first_cell + uint(row) * push.record.at[0].cell_columns + uint(column)].inverse_depth;
}

/// What the inverse depth changes by on the way of `beyond` cells past the border cell (column, row), where the surface goes on to it.
float change_beyond(uint first_cell, int column, int row, int columns_inward, int rows_inward, float beyond) {
  const int step = 4;
  int inner_column = column + step * columns_inward, inner_row = row + step * rows_inward;
  if (inner_column < 0 || inner_row < 0 || inner_column >= int(push.record.at[0].cell_columns) || inner_row >= int(push.record.at[0].cell_rows)) return 0.0f;
  float border = cell_inverse(first_cell, column, row), inner = cell_inverse(first_cell, inner_column, inner_row);
  return inner > 0.0f && abs(border - inner) < 0.1f * border ? abs(beyond) * (border - inner) / float(step) : 0.0f;
}

Met met_in(uint first_cell, vec2 wanted) {
  vec2 most = vec2(float(push.record.at[0].width), float(push.record.at[0].height)) - 1.0f;
  Met m;
  m.pixel = clamp(wanted, vec2(0.0f), most);
  int column = int(uint(m.pixel.x + 0.5f) / gbuffer_cell_px), row = int(uint(m.pixel.y + 0.5f) / gbuffer_cell_px);
  m.cell = first_cell + uint(row) * push.record.at[0].cell_columns + uint(column);
  uint line = first_cell / cells_per_view() * push.record.at[0].height + uint(m.pixel.y + 0.5f);
  m.inverse_depth = push.record.at[0].cameras[0].inverse_depth.at[line * push.record.at[0].width + uint(m.pixel.x + 0.5f)];
  vec2 beyond = (wanted - m.pixel) / float(gbuffer_cell_px);
  if (m.inverse_depth == 0.0f) return m;
  if (beyond.x != 0.0f) m.inverse_depth += change_beyond(first_cell, column, row, beyond.x < 0.0f ? 1 : -1, 0, beyond.x);
  if (beyond.y != 0.0f) m.inverse_depth += change_beyond(first_cell, column, row, 0, beyond.y < 0.0f ? 1 : -1, beyond.y);
  return m;
}

Met met_at(IN(GbufferCamera) camera, uint first_cell, vec3 q) { return met_in(first_cell, camera.centre + camera.focal * xy(q) / q.z); }

/// On one side of a slice, whose normal is `axis`; `side` is the way on the image, `tilt` the normal's in the slice, towards that side. Of its
/// sectors, which send equal shares of light, each thing hides those between its front and its back (Therrien et al., "Screen Space Indirect
/// Lighting with Visibility Bitmask", 2023).
Horizon look_along(IN(GbufferCamera) camera, uint first_cell, vec3 here, vec3 to_camera, vec3 axis, vec2 pixel, vec2 side, float tilt, float reach) {
  Horizon found = Horizon(0.0f, 0.0f, 0.0f);
  float highest = min(tilt + 0.5f * pi, pi), all = horizon_arc(highest, tilt), per_sector = max(all, 1e-4f) / float(horizon_sectors);
  float before_x = 0.0f, before_z = 0.0f, before_angle = highest;
  uint hidden = 0u;
  for (int s = 0; s < horizon_steps; ++s) {
    vec2 at = pixel + side * (reach * float(gbuffer_cell_px));
    reach *= horizon_growth;
    Met m = met_in(first_cell, at);
    if (!(m.inverse_depth > 1e-3f)) continue;
    vec3 way = seen_position(camera, at, m.inverse_depth) - here;
    way -= axis * dot(way, axis);
    float z = dot(way, to_camera), x = sqrt(max(dot(way, way) - z * z, 1e-12f)), distance = sqrt(x * x + z * z);
    float near = horizon_reach_m / (horizon_reach_m + max(distance - horizon_reach_m, 0.0f));
    float angle = mix(highest, angle_of(z / max(distance, 1e-6f)), near * near);
    float back_z = z - thickness_m, back = angle_of(back_z * inversesqrt(x * x + back_z * back_z));
    bool goes_on = abs(z - before_z) < steepest_surface * abs(x - before_x);
    float last = goes_on ? max(back, before_angle) : back;
    before_z = z;
    before_x = x;
    before_angle = angle;
    if (!(angle < highest)) continue;
    uint from = uint(max(horizon_arc(angle, tilt), 0.0f) / per_sector + 0.5f), to = min(uint(max(horizon_arc(min(last, highest), tilt), 0.0f) / per_sector + 0.5f), uint(horizon_sectors));
    if (from >= to) continue;
    uint sectors = (0xffffffffu >> (uint(horizon_sectors) + from - to)) << from, fresh = sectors & ~hidden;
    float share = float(bitCount(fresh)) * per_sector;
    hidden |= sectors;
    found.laser += share * push.record.at[0].cells.at[m.cell].laser;
    found.albedo += share * push.record.at[0].cells.at[m.cell].albedo;
  }
  found.room = max(all - float(bitCount(hidden)) * per_sector, 0.0f);
  return found;
}

/// What arrives at a cell of the room's light and of surfaces' laser.
void look_around(uint i) {
  GbufferPlace p = cell_place(i);
  IN(GbufferCamera) camera = push.record.at[0].cameras[0];
  GbufferSurface s = surface_at_pixel(p);
  push.record.at[0].cells.at[i].room = 1.0f;
  push.record.at[0].cells.at[i].indirect = 0.0f;
  if (s.inverse_depth == 0.0f) return;
  vec2 pixel = vec2(float(p.column), float(p.row));
  vec3 here = seen_position(camera, pixel, s.inverse_depth), to_camera = in_camera(camera, s.to_camera), normal = in_camera(camera, s.normal);
  uint first_cell = i / cells_per_view() * cells_per_view();
  Horizon sum = Horizon(0.0f, 0.0f, 0.0f);
  uint cell_column = p.column / gbuffer_cell_px, cell_row = p.row / gbuffer_cell_px;
  // Neighbours, which are mixed (smooth_cell), look other ways and at other distances, which are of the imagers' pixels.
  float all = 0.0f, turn = 0.25f * float((cell_column & 1u) + 2u * ((cell_row + cell_column) & 1u)) + 0.125f;
  float reach = pow(horizon_growth, turn - 0.5f) * float(push.record.at[0].supersampling);
  for (int slice = 0; slice < horizon_slices; ++slice) {
    vec2 side = unit_circle((float(slice) + turn) * (0.5f / float(horizon_slices)));
    vec3 across = vec3(side.x / camera.focal.x, side.y / camera.focal.y, 0.0f);
    vec3 along = normalize(across - to_camera * dot(across, to_camera)), axis = cross(along, to_camera);
    vec3 in_slice = normal - axis * dot(normal, axis);
    float weight = length(in_slice), tilt = atan(dot(in_slice, along), dot(in_slice, to_camera));
    Horizon a = look_along(camera, first_cell, here, to_camera, axis, pixel, side, tilt, reach);
    Horizon b = look_along(camera, first_cell, here, to_camera, axis, pixel, -side, -tilt, reach);
    sum.room += weight * (a.room + b.room);
    sum.laser += weight * (a.laser + b.laser);
    sum.albedo += weight * (a.albedo + b.albedo);
    all += weight * (horizon_arc(min(tilt + 0.5f * pi, pi), tilt) + horizon_arc(min(-tilt + 0.5f * pi, pi), -tilt));
  }
  // Surfaces about it get as much of the room as it does, and of one another's light as they send to it.
  float scale = 1.0f / max(all, 1e-6f), back = 1.0f / (1.0f - sum.albedo * scale);
  push.record.at[0].cells.at[i].room = sum.room * scale * back;
  push.record.at[0].cells.at[i].indirect = sum.laser * scale * back;
}

/// The column in which the left camera has what a pixel shows, or the first one past what hides it there.
float left_column(IN(GbufferPlace) p, float inverse) {
  float column = float(p.column);
  if (p.camera == 0u) return column;
  float last = float(push.record.at[0].width) - 1.0f, aside = push.record.at[0].baseline_px_m < 0.0f ? -1.0f : 1.0f;
  column = clamp(column + push.record.at[0].baseline_px_m * inverse - push.record.at[0].cameras[1].shift_px, 0.0f, last);
  uint first = p.pixel - p.column;
  for (int s = 0; s < hidden_steps; ++s) {
    float seen = push.record.at[0].cameras[0].inverse_depth.at[first + uint(column + 0.5f)], next = column + aside * float(gbuffer_cell_px);
    if (seen < inverse * hides || next < 0.0f || next > last) break;
    column = next;
  }
  return column;
}

/// How much a cell, whose middle is `pixel`, is of the same surface as a point.
float same_surface(uint cell, vec2 pixel, vec3 point) {
  IN(GbufferCell) c = push.record.at[0].cells.at[cell];
  if (!(c.inverse_depth > 0.0f)) return 0.0f;
  float apart = dot(c.normal, point - seen_position(push.record.at[0].cameras[0], pixel, c.inverse_depth)) / (plane_share * point.z);
  return 1.0f / (1.0f + apart * apart);
}

/// The middle pixel of a cell.
vec2 cell_pixel(int column, int row) { return vec2(float(column), float(row)) * float(gbuffer_cell_px) + float(gbuffer_cell_px / 2u); }

/// Mixes what arrives at a cell with its neighbours of the same surface: each of the four ways of looking counts as much.
void smooth_cell(uint i) {
  IN(GbufferCell) own = push.record.at[0].cells.at[i];
  GbufferPlace p = cell_place(i);
  int own_column = int(p.column / gbuffer_cell_px), own_row = int(p.row / gbuffer_cell_px);
  vec3 point = seen_position(push.record.at[0].cameras[0], cell_pixel(own_column, own_row), max(own.inverse_depth, 1e-20f));
  vec2 sum = 4.0f * vec2(own.room, own.indirect);
  float weights = 4.0f;
  for (int k = 0; k < 9; ++k) {
    int x = k % 3 - 1, y = k / 3 - 1, column = own_column + x, row = own_row + y;
    if (k == 4 || column < 0 || row < 0 || column >= int(push.record.at[0].cell_columns) || row >= int(push.record.at[0].cell_rows)) continue;
    uint cell = p.environment * cells_per_view() + uint(row) * push.record.at[0].cell_columns + uint(column);
    IN(GbufferCell) c = push.record.at[0].cells.at[cell];
    float alike = max(dot(c.normal, own.normal), 0.0f);
    float weight = float((2 - x * x) * (2 - y * y)) * same_surface(cell, cell_pixel(column, row), point) * alike * alike * alike * alike;
    sum += weight * vec2(c.room, c.indirect);
    weights += weight;
  }
  push.record.at[0].cells.at[i].smooth_room = sum.x / weights;
  push.record.at[0].cells.at[i].smooth_indirect = sum.y / weights;
}

/// Shares of the room and the indirect radiance at a pixel of the left camera: of the cells about it, those that are of its surface.
vec2 arriving_at(uint first_cell, vec2 pixel, float inverse) {
  vec2 place = pixel / float(gbuffer_cell_px) - 0.5f, base = floor(place), f = place - base;
  vec2 sum = vec2(0.0f);
  vec3 point = seen_position(push.record.at[0].cameras[0], pixel, inverse);
  float weights = 0.0f;
  for (int k = 0; k < 4; ++k) {
    int x = k & 1, y = k >> 1;
    int column = clamp(int(base.x) + x, 0, int(push.record.at[0].cell_columns) - 1), row = clamp(int(base.y) + y, 0, int(push.record.at[0].cell_rows) - 1);
    uint cell = first_cell + uint(row) * push.record.at[0].cell_columns + uint(column);
    float weight = ((x == 1 ? f.x : 1.0f - f.x) * (y == 1 ? f.y : 1.0f - f.y) + 1e-3f) * (same_surface(cell, cell_pixel(column, row), point) + 1e-3f);
    sum += weight * vec2(push.record.at[0].cells.at[cell].smooth_room, push.record.at[0].cells.at[cell].smooth_indirect);
    weights += weight;
  }
  return sum / weights;
}

/// How far a point lies behind what is seen there, metres; below 0: before it, or there is nothing.
float behind_seen(IN(Met) m, vec3 q) { return m.inverse_depth > 0.0f ? q.z - 1.0f / m.inverse_depth : -1.0f; }

/// The light of what is seen about a place, of the room and of the projector, as matt surfaces send it, of those cells whose depth is about
/// that of the place's own.
vec2 seen_light(uint first_cell, IN(Met) m, float ambient) {
  vec2 place = m.pixel / float(gbuffer_cell_px) - 0.5f, base = floor(place), f = place - base;
  int columns = int(push.record.at[0].cell_columns), rows = int(push.record.at[0].cell_rows);
  float inverse = push.record.at[0].cells.at[m.cell].inverse_depth;
  vec2 sum = vec2(0.0f);
  float weights = 0.0f;
  for (int k = 0; k < 4; ++k) {
    int x = k & 1, y = k >> 1;
    int column = clamp(int(base.x) + x, 0, columns - 1), row = clamp(int(base.y) + y, 0, rows - 1);
    IN(GbufferCell) cell = push.record.at[0].cells.at[first_cell + uint(row * columns + column)];
    float there = cell.inverse_depth;
    float weight = ((x == 1 ? f.x : 1.0f - f.x) * (y == 1 ? f.y : 1.0f - f.y) + 1e-3f) * (there > 0.0f ? 1.0f : 0.0f) * (abs(there - inverse) < 0.15f * inverse ? 1.0f : 1e-3f);
    sum += weight * vec2(cell.albedo * cell.smooth_room * ambient, cell.laser + cell.albedo * cell.smooth_indirect);
    weights += weight;
  }
  return weights > 0.0f ? sum / weights : vec2(ambient, 0.0f);
}

/// What comes along a ray: the light of the surface that it meets in the image, or the room's.
vec2 light_along(IN(GbufferCamera) camera, uint first_cell, vec3 here, vec3 direction, float first_step_m, float growth, float ambient) {
  float t = first_step_m, before = 0.0f;
  for (int s = 0; s < mirror_steps; ++s) {
    vec3 q = here + t * direction;
    if (q.z < 1e-3f) break;
    Met m = met_at(camera, first_cell, q);
    float behind = behind_seen(m, q);
    if (behind > 0.0f && behind < max(0.1f, 2.0f * t)) {
      for (int half_step = 0; half_step < 3; ++half_step) {
        float middle = 0.5f * (before + t);
        q = here + middle * direction;
        bool beyond = behind_seen(met_at(camera, first_cell, q), q) > 0.0f;
        t = beyond ? middle : t;
        before = beyond ? before : middle;
      }
      return seen_light(first_cell, met_at(camera, first_cell, here + t * direction), ambient);
    }
    before = t;
    t *= growth;
  }
  return vec2(ambient, 0.0f);
}

/// What lobes get of the room and of the projector, as their BSDF weighs it, by facets that the camera sees. The samples of an imager's pixel
/// look along different rays.
vec2 mirrored_light(uint first_cell, IN(GbufferSurface) s, IN(GbufferPlace) p, int rays, float ambient) {
  IN(GbufferCamera) camera = push.record.at[0].cameras[0];
  vec3 here = in_camera(camera, s.position - camera.view.origin);
  Frame frame = frame_around(in_camera(camera, s.normal));
  MaterialPoint m = material_at(s);
  vec3 wo = to_local(frame, in_camera(camera, s.to_camera));
  wo.z = max(wo.z, 1e-3f);
  float layer = (1.0f - m.metallic) * mix(m.coat, 1.0f, m.transmission), metal = m.metallic * max_component(m.base), alpha = m.roughness * m.roughness;
  uint n = push.record.at[0].supersampling, own = p.row % n * n + p.column % n;
  float step_m = 1.5f * float(n) / (camera.focal.x * s.inverse_depth), weights = 0.0f;
  float growth = pow(max(mirror_reach_m / step_m, 4.0f), 1.0f / float(mirror_steps - 1));
  vec2 sum = vec2(0.0f);
  for (int k = 0; k < rays; ++k) {
    uint number = uint(k) * n * n + own;
    vec3 h = sample_visible_normal(wo, alpha, vec2(fract(float(number) * golden_turn), (float(number) + 0.5f) / float(uint(rays) * n * n)));
    vec3 wi = reflect(-wo, h);
    if (wi.z <= 0.0f) continue;
    float cosine = dot(wo, h), cos_t;
    float f = metal + (m.metallic - metal) * schlick_weight(cosine) + layer * fresnel_dielectric(min(cosine, 1.0f), 1.0f / m.ior, cos_t);
    float weight = f * ggx_visibility(wo.z, wi.z, max(alpha, mirror_alpha)) * wi.z;
    sum += weight * light_along(camera, first_cell, here, to_world(frame, wi), step_m, growth, ambient);
    weights += weight;
  }
  return weights > 0.0f ? sum / weights : vec2(ambient, 0.0f);
}

void bounce_pixel(uint i, IN(GbufferPlace) p) {
  float inverse = push.record.at[0].cameras[p.camera].inverse_depth.at[p.pixel];
  float ambient = push.record.at[0].ambient.at[p.environment], direct = push.record.at[0].laser.at[i], indirect = 0.0f, room = ambient;
  if (inverse > 0.0f) {
    uint first_cell = p.environment * cells_per_view();
    vec2 arriving = arriving_at(first_cell, vec2(left_column(p, inverse), float(p.row)), inverse);
    float matt = push.record.at[0].matt.at[i], lobes = push.record.at[0].lobes.at[i];
    int rays = (lobes > weak_lobes ? mirror_rays : mirror_rays / 2) / int(push.record.at[0].supersampling);
    vec2 mirrored = lobes > 0.0f ? mirrored_light(first_cell, surface_at_pixel(p), p, rays, ambient) : vec2(0.0f);
    room = matt * arriving.x * ambient + lobes * mirrored.x;
    indirect = matt * arriving.y + lobes * mirrored.y;
  }
  push.record.at[0].room.at[i] = room;
  push.record.at[0].laser.at[i] = direct + indirect;
  write_output(output_radiance + 1u + group_projector_direct, p, push.record.at[0].laser_as_one != 0u ? direct + indirect : direct);
  write_output(output_radiance + 1u + group_projector_indirect, p, indirect);
}

/// Whether a pixel's neighbours along its row or its column lie off a plane with it.
bool is_bent(FloatArray inverse_depth, uint pixel, int stride, float inverse, float most) {
  return abs(inverse_depth.at[int(pixel) - stride] + inverse_depth.at[int(pixel) + stride] - 2.0f * inverse) > most;
}

/// The room's light over a pixel's square, which an edge crosses where three or more of its eight neighbours show another surface: of random
/// straight edges, 0.2 of the square is theirs with three neighbours and 0.4 with four.
void blend_pixel(uint i, IN(GbufferPlace) p) {
  IN(GbufferCamera) camera = push.record.at[0].cameras[p.camera];
  float inverse = camera.inverse_depth.at[p.pixel], room = push.record.at[0].room.at[i], most = edge_px * inverse / push.record.at[0].focal_px;
  int width = int(push.record.at[0].width);
  bool is_inside = p.row > 0u && p.column > 0u && p.row + 1u < push.record.at[0].height && p.column + 1u < push.record.at[0].width;
  if (is_inside && (is_bent(camera.inverse_depth, p.pixel, 1, inverse, most) || is_bent(camera.inverse_depth, p.pixel, width, inverse, most))) {
    GbufferSurface s = surface_at_pixel(p);
    float towards = dot(s.normal, s.way), cosine = dot(s.normal, s.to_camera);
    float others = 0.0f, sum = 0.0f, weights = 0.0f;
    for (int k = 0; k < 9; ++k) {
      int x = k % 3 - 1, y = k / 3 - 1, aside = y * width + x;
      float there = camera.inverse_depth.at[int(p.pixel) + aside];
      vec3 way = pixel_way(camera.view, float(int(p.column) + x), float(int(p.row) + y));
      float plane = inverse * dot(s.normal, way) / min(towards, -1e-6f);
      if (abs(there - plane) * cosine * cosine <= most) continue;
      float weight = x == 0 || y == 0 ? 1.0f : 0.25f;
      others += 1.0f;
      sum += weight * push.record.at[0].room.at[int(i) + aside];
      weights += weight;
    }
    if (others > 2.0f) room = mix(room, sum / weights, 0.2f * min(others - 2.0f, 2.0f));
  }
  write_output(output_radiance, p, room + push.record.at[0].laser.at[i]);
}

/// A pixel of an imager gets the mean of its samples; its depth is that of one in the middle.
void average_pixel(uint i) {
  uint n = push.record.at[0].supersampling, columns = push.record.at[0].width / n, rows = push.record.at[0].height / n;
  Pixel p = Pixel(i / columns / rows, i / columns % rows, i % columns);
  for (uint kind = 0u; kind < output_kind_count; ++kind) {
    IN(OutputRecord) samples = push.record.at[0].outputs.at[kind];
    IN(OutputRecord) pixels = push.record.at[0].averaged.at[kind];
    if (samples.enabled == 0u) continue;
    bool is_depth = kind == output_depth;
    uint first = is_depth ? n / 2u : 0u, side = is_depth ? 1u : n;
    float sum = 0.0f;
    for (uint k = 0u; k < side * side; ++k) {
      Pixel sample_pixel = Pixel(p.view, p.row * n + first + k / side, p.column * n + first + k % side);
      sum += uintBitsToFloat(samples.words.at[output_element(samples, sample_pixel, 1u)]);
    }
    pixels.words.at[output_element(pixels, p, 1u)] = floatBitsToUint(sum / float(side * side));
  }
}

void gbuffer_step(uint i) {
  if (step == gbuffer_read) read_pixel(i);
  else if (step == gbuffer_between) mark_between(i);
  else if (step == gbuffer_middles) mark_middle(i);
  else if (step == gbuffer_warp) warp_pixel(i);
  else if (step == gbuffer_light) light_pixel(i);
  else if (step == gbuffer_cells) mean_of_cell(i);
  else if (step == gbuffer_sky) look_around(i);
  else if (step == gbuffer_smooth) smooth_cell(i);
  else if (step == gbuffer_bounce) bounce_pixel(i, gbuffer_place(i));
  else if (step == gbuffer_blend) blend_pixel(i, gbuffer_place(i));
  else average_pixel(i);
}
