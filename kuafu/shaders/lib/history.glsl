// SPDX-License-Identifier: Apache-2.0
// Where the last launch saw what a pixel shows now; includers have what lib/guide.glsl asks for, `push.last_views` and
// `push.last_local_to_world`, and include it where `push` is.

/// In pixels; false behind the camera. A camera that moves sees a point at the time of the line that it falls on.
bool seen_at(HistoryView view, vec3 position, OUT(vec2) image_point) {
  image_point = 0.5f * vec2(float(push.range.width - 1u), float(push.range.height - 1u));
  vec2 middle = image_point;
  for (uint step = 0u; step < 3u; ++step) {
    float seconds = dot(image_point - middle, view.seconds_per_pixel);
    vec3 p = view.motion.moves != 0u ? unmoved_point(view.motion, seconds, position) : position;
    if (!project_to_image(view.camera, view.camera.now, p, image_point)) return false;
    if (view.motion.moves == 0u) break;
  }
  return true;
}

/// A normal of the instance, turned back to how it stood.
vec3 normal_before(InstanceRecord r, uint row, vec3 normal) {
  vec3 a = xyz(push.last_local_to_world.at[row]), b = xyz(push.last_local_to_world.at[row + 1u]), c = xyz(push.last_local_to_world.at[row + 2u]);
  vec3 local = normal.x * xyz(r.local_to_world[0]) + normal.y * xyz(r.local_to_world[1]) + normal.z * xyz(r.local_to_world[2]);
  vec3 n = vec3(dot(cross(b, c), local), dot(cross(c, a), local), dot(cross(a, b), local));
  return normalize(dot(a, cross(b, c)) < 0.0f ? -n : n);
}

PlaceRecord place_of_ray(uint i, uint view, GuideRecord g) {
  PlaceRecord place;
  place.instance = miss;
  place.position = g.position;
  place.normal = g.normal;
  place.image_point = vec2(-2.0f);
  if (guide_word(i, hit_geometry) == miss) return place;
  uint slot = guide_word(i, hit_instance), primitive = guide_word(i, hit_primitive);
  InstanceRecord r = push.scene.at[0].instances.at[slot];
  place.instance = r.id;
  vec3 first = xyz(push.last_local_to_world.at[3u * slot]);
  if (push.history < 2u || dot(first, first) == 0.0f) return place;
  // What it does while the shutter is open it did then, too.
  vec3 local = local_position(r, primitive, uintBitsToFloat(guide_word(i, hit_u)), uintBitsToFloat(guide_word(i, hit_v)));
  vec3 now = vec3(0.0f), before = vec3(0.0f);
  for (uint k = 0u; k < 3u; ++k) {
    vec4 row = push.last_local_to_world.at[3u * slot + k];
    now[int(k)] = dot(xyz(r.local_to_world[k]), local) + r.local_to_world[k].w;
    before[int(k)] = dot(xyz(row), local) + row.w;
  }
  place.position = before + (g.position - now);
  place.normal = normal_before(r, 3u * slot, g.normal);
  vec2 image_point;
  if (seen_at(push.last_views.at[view], place.position, image_point)) place.image_point = image_point;
  return place;
}
