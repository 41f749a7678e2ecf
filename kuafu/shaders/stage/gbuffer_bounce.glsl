// SPDX-License-Identifier: Apache-2.0
// Stage `gbuffer`, light between surfaces, as far as the image shows them. Matt surfaces get the room's light past what the depth image has
// about them, and from that what it sends out (Jimenez et al., "Practical Realtime Strategies for Accurate Indirect Occlusion", 2016); lobes
// look along mirrored rays (stage/gbuffer_lobes.glsl). All of it is found in the left camera's image, for both cameras: a point that sends
// light to all sides has one radiance, and what two images miss of it differs.
const int horizon_sectors = 32;
const float horizon_growth = 2.0f;    // of the steps
const float horizon_reach_m = 3.0f;   // what is farther away hides half of what it would, or less
const float thickness_m = 0.15f;      // of things, along the view
const float steepest_surface = 3.0f;  // a tangent: between steps that part more, the image shows an edge
const uint border_cells = 4u;         // along which a surface's depth goes on past the border
const float plane_share = 4e-3f;      // of its distance: a point that lies so far from a cell's plane is of its surface by half
const float no_plane_m = 1e20f;       // of a cell where nothing is
const int hidden_steps = 12;          // of a cell, past what hides a point from the left camera
const float hides = 1.05f;            // times a point's 1/m

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

/// What 1/m changes by from the cell `inner` to one at the border, per cell, where a surface goes on between them; past the border it changes
/// so, too (inverse depth is linear in a plane's image).
float change_to_border(float border, uint inner) {
  float before = push.record.at[0].cameras[0].inverse_depth.at[cell_place(inner).pixel];
  return before > 0.0f && abs(border - before) < 0.1f * border ? (border - before) / float(border_cells) : 0.0f;
}

vec3 seen_position(IN(GbufferCamera) camera, vec2 pixel, float inverse) {
  return vec3((pixel.x - camera.centre.x) / camera.focal.x, (pixel.y - camera.centre.y) / camera.focal.y, 1.0f) / inverse;
}

vec2 pixel_of(IN(GbufferPlace) p) { return vec2(float(p.column), float(p.row)); }

/// The same past the border that a cell is at, along columns and rows.
vec2 change_beyond(uint i, IN(GbufferPlace) p, float inverse) {
  uint columns = push.record.at[0].cell_columns, rows = push.record.at[0].cell_rows;
  uint column = p.column / gbuffer_cell_px, row = p.row / gbuffer_cell_px, down = border_cells * columns;
  vec2 change = vec2(0.0f);
  if (columns > border_cells && (column == 0u || column + 1u == columns))
    change.x = change_to_border(inverse, column == 0u ? i + border_cells : i - border_cells);
  if (rows > border_cells && (row == 0u || row + 1u == rows)) change.y = change_to_border(inverse, row == 0u ? i + down : i - down);
  return change;
}

void mean_of_cell(uint i) {
  if (i == 0u) push.record.at[0].lobe_pixels.at[0] = push.record.at[0].lobe_pixels.at[1] = 0u;
  GbufferPlace p = cell_place(i);
  uint first_row = p.row / gbuffer_cell_px * gbuffer_cell_px, first_column = p.column / gbuffer_cell_px * gbuffer_cell_px;
  uint base = p.environment * pixels_per_view();
  float laser = 0.0f, albedo = 0.0f, count = 0.0f;
  for (uint row = first_row; row < min(first_row + gbuffer_cell_px, push.record.at[0].height); ++row)
    for (uint column = first_column; column < min(first_column + gbuffer_cell_px, push.record.at[0].width); ++column) {
      uint at = base + row * push.record.at[0].width + column;
      laser += push.record.at[0].laser.at[at];
      albedo += push.record.at[0].matt.at[at] + push.record.at[0].lobes.at[at];
      count += 1.0f;
    }
  GbufferSurface s = surface_at_pixel(p);
  IN(GbufferCamera) camera = push.record.at[0].cameras[0];
  bool found = s.inverse_depth > 0.0f;
  vec3 normal = found ? in_camera(camera, s.normal) : vec3(0.0f, 0.0f, -1.0f);
  float plane_m = found ? dot(normal, seen_position(camera, pixel_of(p), s.inverse_depth)) : no_plane_m;
  vec2 beyond = change_beyond(i, p, s.inverse_depth);
  push.record.at[0].cells.at[i].plane = vec4(normal.x, normal.y, normal.z, plane_m);
  push.record.at[0].cells.at[i].own = vec4(laser / count, albedo / count, beyond.x, beyond.y);
  push.record.at[0].cells.at[i].sent = vec4(s.inverse_depth, 0.0f, 0.0f, 0.0f);
}

/// acos without a call (Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.45), off by 7e-5 at most.
float angle_of(float cosine) {
  float x = abs(cosine);
  float near = (1.5707288f + x * (-0.2121144f + x * (0.0742610f - x * 0.0187293f))) * sqrt(max(1.0f - x, 0.0f));
  return cosine < 0.0f ? pi - near : near;
}

/// The left camera's image of an environment, as ways through the room need it again and again.
struct SeenImage {
  FloatArray inverse_depth;
  GbufferCells cells;
  uint width, cell_columns, first_pixel, first_cell;
  vec2 focal, centre, last_pixel;
};

SeenImage seen_image(uint environment) {
  SeenImage s;
  s.inverse_depth = push.record.at[0].cameras[0].inverse_depth;
  s.cells = push.record.at[0].cells;
  s.width = push.record.at[0].width;
  s.cell_columns = push.record.at[0].cell_columns;
  s.first_pixel = environment * pixels_per_view();
  s.first_cell = environment * cells_per_view();
  s.focal = push.record.at[0].cameras[0].focal;
  s.centre = push.record.at[0].cameras[0].centre;
  s.last_pixel = vec2(float(s.width - 1u), float(push.record.at[0].height - 1u));
  return s;
}

/// Where a way through the room meets the image: its cell, and 1/m of what stands there, which goes on in its plane beyond the border; 0
/// where nothing is seen.
struct Met {
  vec2 pixel;
  uint cell;
  float inverse_depth;
};

bool is_past_border(IN(SeenImage) image, vec2 pixel) {
  return pixel.x < 0.0f || pixel.y < 0.0f || pixel.x > image.last_pixel.x || pixel.y > image.last_pixel.y;
}

Met met_in(IN(SeenImage) image, vec2 wanted, bool past_border) {
  Met m;
  m.pixel = clamp(wanted, vec2(0.0f), image.last_pixel);
  uint column = uint(int(m.pixel.x + 0.5f)), row = uint(int(m.pixel.y + 0.5f));
  m.cell = image.first_cell + row / gbuffer_cell_px * image.cell_columns + column / gbuffer_cell_px;
  m.inverse_depth = image.inverse_depth.at[int(image.first_pixel + row * image.width + column)];
  if (!past_border) return m;
  vec2 beyond = abs(wanted - m.pixel) / float(gbuffer_cell_px), change = vec2(image.cells.at[m.cell].own.z, image.cells.at[m.cell].own.w);
  m.inverse_depth += m.inverse_depth > 0.0f ? dot(beyond, change) : 0.0f;
  return m;
}

/// One side of a slice through the camera and a cell's pixel, and what is found on the way along it.
struct Horizon {
  vec2 pixel;
  float depth, stretch;   // of the cell, and how much longer the way to it is
  vec2 side;              // on the image, a pixel long
  float towards, across;  // what a point a pixel aside and 1 m deep is nearer to the camera by, and lies beside the view
  float cosine, sine;     // of the normal's tilt in the slice, towards this side
  float weight, all;      // of the slice; the light that arrives on this side if nothing stands there
  uint hidden;            // a bit for each sector
  float before_z, before_x, before_arc;  // of the last step
  float laser, albedo;    // of what hides: shares of the light, times it
};

/// Share of the light on a surface that comes, within a slice, from between the viewer's direction and the one to (x, z), x across the view.
float horizon_arc(IN(Horizon) h, float x, float z) {
  float scale = inversesqrt(x * x + z * z), c = z * scale, s = x * scale;
  float arc = 0.5f * (h.cosine * s * s - h.sine * s * c + h.sine * angle_of(c));
  return c * h.cosine + s * h.sine > 0.0f ? max(arc, 0.0f) : h.all;
}

Horizon make_horizon(vec2 pixel, float depth, float stretch, vec3 to_camera, vec3 normal, vec2 side) {
  Horizon h;
  h.pixel = pixel;
  h.depth = depth;
  h.stretch = stretch;
  h.side = side;
  vec2 focal = push.record.at[0].cameras[0].focal;
  vec3 aside = vec3(side.x / focal.x, side.y / focal.y, 0.0f);
  h.towards = dot(aside, to_camera);
  vec3 across = aside - to_camera * h.towards;
  h.across = max(sqrt(dot(across, across)), 1e-12f);
  float z = max(dot(normal, to_camera), 1e-6f), x = dot(normal, across) / h.across;
  h.weight = sqrt(z * z + x * x);
  h.cosine = z / h.weight;
  h.sine = x / h.weight;
  h.all = 0.5f * (h.cosine + h.sine * (pi - angle_of(h.sine)));
  h.hidden = 0u;
  h.before_z = h.before_x = h.laser = h.albedo = 0.0f;
  h.before_arc = h.all;
  return h;
}

/// Of a side's sectors, which send equal shares of light, each thing hides those between its front and its back (Therrien et al., "Screen
/// Space Indirect Lighting with Visibility Bitmask", 2023).
void look_farther(IN(SeenImage) image, float reach, bool past_border, INOUT(Horizon) h) {
  Met m = met_in(image, h.pixel + h.side * reach, past_border);
  float depth = 1.0f / max(m.inverse_depth, 1e-3f);
  float x = reach * depth * h.across, z = (h.depth - depth) * h.stretch + reach * depth * h.towards;
  float near = min(horizon_reach_m * horizon_reach_m / (x * x + z * z), 1.0f), per_sector = max(h.all, 1e-4f) / float(horizon_sectors);
  float arc = mix(h.all, horizon_arc(h, x, z), near), back = horizon_arc(h, x, z - thickness_m);
  float last = abs(z - h.before_z) < steepest_surface * abs(x - h.before_x) ? max(back, h.before_arc) : back;
  bool found = m.inverse_depth > 1e-3f;
  int from = int(arc / per_sector + 0.5f), to = min(int(last / per_sector + 0.5f), horizon_sectors);
  uint sectors = found && from < to ? (0xffffffffu >> uint(horizon_sectors + from - to)) << uint(from) : 0u;
  float share = float(bitCount(sectors & ~h.hidden)) * per_sector;
  h.hidden |= sectors;
  h.before_z = found ? z : h.before_z;
  h.before_x = found ? x : h.before_x;
  h.before_arc = found ? arc : h.before_arc;
  vec4 own = image.cells.at[m.cell].own;
  h.laser += share * own.x;
  h.albedo += share * own.y;
}

/// Neighbours, which are mixed (smooth_cell), look other ways and at other distances.
float horizon_turn(IN(GbufferPlace) p) {
  uint column = p.column / gbuffer_cell_px, row = p.row / gbuffer_cell_px;
  return 0.25f * float((column & 1u) + 2u * ((row + column) & 1u)) + 0.125f;
}

vec2 horizon_side(float turn, uint k) { return unit_circle((float(k) + turn) * (1.0f / float(gbuffer_horizon_sides))); }

/// To the first step, in pixels, which are of the imagers'.
float first_reach(float turn) { return pow(horizon_growth, turn - 0.5f) * float(push.record.at[0].supersampling * gbuffer_cell_px); }

/// What all sides found.
struct Surroundings {
  float room, laser, albedo, all;
};

void add_horizon(IN(Horizon) h, INOUT(Surroundings) sum) {
  sum.room += h.weight * h.all * (1.0f - float(bitCount(h.hidden)) / float(horizon_sectors));
  sum.laser += h.weight * h.laser;
  sum.albedo += h.weight * h.albedo;
  sum.all += h.weight * h.all;
}

/// Surfaces about a cell get as much of the room as it does, and of one another's light as they send to it.
void write_surroundings(uint i, IN(Surroundings) sum) {
  float scale = 1.0f / max(sum.all, 1e-6f), back = 1.0f / (1.0f - sum.albedo * scale);
  push.record.at[0].cells.at[i].arriving = vec2(sum.all > 0.0f ? sum.room * scale * back : 1.0f, sum.laser * scale * back);
}

/// What arrives at a cell of the room's light and of surfaces' laser.
void look_around(uint i) {
  GbufferPlace p = cell_place(i);
  GbufferSurface s = surface_at_pixel(p);
  Surroundings sum = Surroundings(0.0f, 0.0f, 0.0f, 0.0f);
  if (s.inverse_depth > 0.0f) {
    IN(GbufferCamera) camera = push.record.at[0].cameras[0];
    vec3 to_camera = in_camera(camera, s.to_camera), normal = in_camera(camera, s.normal);
    float turn = horizon_turn(p);
    SeenImage image = seen_image(p.environment);
    for (uint k = 0u; k < gbuffer_horizon_sides; ++k) {
      Horizon h = make_horizon(pixel_of(p), 1.0f / s.inverse_depth, length(s.way), to_camera, normal, horizon_side(turn, k));
      float reach = first_reach(turn);
      for (uint n = 0u; n < gbuffer_horizon_steps; ++n) {
        look_farther(image, reach, is_past_border(image, h.pixel + h.side * reach), h);
        reach *= horizon_growth;
      }
      add_horizon(h, sum);
    }
  }
  write_surroundings(i, sum);
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

/// How much a cell is of the same surface as a point.
float same_surface(vec4 plane, vec3 point) {
  float apart = (dot(xyz(plane), point) - plane.w) / (plane_share * point.z);
  return 1.0f / (1.0f + apart * apart);
}

/// Mixes what arrives at a cell with its neighbours of the same surface: each of the four ways of looking counts as much.
void smooth_cell(uint i) {
  IN(GbufferCell) own = push.record.at[0].cells.at[i];
  GbufferPlace p = cell_place(i);
  int own_column = int(p.column / gbuffer_cell_px), own_row = int(p.row / gbuffer_cell_px);
  vec3 point = seen_position(push.record.at[0].cameras[0], pixel_of(p), max(own.sent.x, 1e-20f));
  vec2 sum = 4.0f * own.arriving;
  float weights = 4.0f;
  for (int k = 0; k < 9; ++k) {
    int x = k % 3 - 1, y = k / 3 - 1, column = own_column + x, row = own_row + y;
    if (k == 4 || column < 0 || row < 0 || column >= int(push.record.at[0].cell_columns) || row >= int(push.record.at[0].cell_rows)) continue;
    uint cell = p.environment * cells_per_view() + uint(row) * push.record.at[0].cell_columns + uint(column);
    IN(GbufferCell) c = push.record.at[0].cells.at[cell];
    float alike = max(dot(xyz(c.plane), xyz(own.plane)), 0.0f);
    float weight = float((2 - x * x) * (2 - y * y)) * same_surface(c.plane, point) * alike * alike * alike * alike;
    sum += weight * c.arriving;
    weights += weight;
  }
  vec2 arriving = sum / weights;
  push.record.at[0].cells.at[i].smooth_arriving = arriving;
  push.record.at[0].cells.at[i].sent = vec4(own.sent.x, own.own.y * arriving.x, own.own.x + own.own.y * arriving.y, 0.0f);
}

/// One of the four cells about a pixel, and how near it is.
struct NearCell {
  uint cell;
  float near;
};

NearCell near_cell(uint environment, vec2 pixel, int k) {
  vec2 place = pixel / float(gbuffer_cell_px) + 0.5f;
  int x = k & 1, y = k >> 1, column = int(place.x), row = int(place.y);
  float aside = place.x - float(column), below = place.y - float(row);
  column = clamp(column - 1 + x, 0, int(push.record.at[0].cell_columns) - 1);
  row = clamp(row - 1 + y, 0, int(push.record.at[0].cell_rows) - 1);
  uint cell = environment * cells_per_view() + uint(row) * push.record.at[0].cell_columns + uint(column);
  return NearCell(cell, (x == 1 ? aside : 1.0f - aside) * (y == 1 ? below : 1.0f - below) + 1e-3f);
}

/// Room and indirect of a cell, and its weight.
vec3 weighed_arriving(IN(NearCell) c, vec3 point) {
  vec2 arriving = push.record.at[0].cells.at[c.cell].smooth_arriving;
  return c.near * (same_surface(push.record.at[0].cells.at[c.cell].plane, point) + 1e-3f) * vec3(arriving.x, arriving.y, 1.0f);
}

/// Shares of the room and the indirect radiance at a pixel of the left camera: of the cells about it, those that are of its surface.
vec2 arriving_at(uint environment, vec2 pixel, float inverse) {
  vec3 point = seen_position(push.record.at[0].cameras[0], pixel, inverse);
  vec3 sum = weighed_arriving(near_cell(environment, pixel, 0), point) + weighed_arriving(near_cell(environment, pixel, 1), point);
  sum += weighed_arriving(near_cell(environment, pixel, 2), point) + weighed_arriving(near_cell(environment, pixel, 3), point);
  return xy(sum) / sum.z;
}
