// SPDX-License-Identifier: Apache-2.0
// Where the camera sees a surface point now, less where it saw it one frame before.
#ifndef KUAFU_MOTION_VECTOR_GLSL
#define KUAFU_MOTION_VECTOR_GLSL
#include "lib/distortion.glsl"
#include "lib/surface.glsl"
#include "shared/aov_record.h"

/// False behind the camera.
bool project_to_image(MotionView view, CameraPose pose, vec3 position, OUT(vec2) image_point) {
  vec3 way = position - pose.origin;
  vec3 d = vec3(dot(pose.axis_x, way), dot(pose.axis_y, way), dot(pose.axis_z, way));
  if (d.z <= 0.0f) return false;
  vec2 p = distort(view.lens, xy(d) / d.z);
  image_point = vec2(view.focal.x * p.x + view.skew * p.y + view.centre.x, view.focal.y * p.y + view.centre.y);
  return true;
}

/// The point (u, v) of a triangle of this instance, in its own frame.
vec3 local_position(IN(InstanceRecord) r, uint primitive, float u, float v) {
  uvec3 vertices = r.indices.at[primitive];
  vec3 p_0 = r.positions.at[vertices.x];
  return p_0 + u * (r.positions.at[vertices.y] - p_0) + v * (r.positions.at[vertices.z] - p_0);
}

/// The same in the world, at t = 0.
vec3 standing_position(InstanceRecord r, uint primitive, float u, float v) {
  vec4 local = vec4(local_position(r, primitive, u, v), 1.0f);
  return vec3(dot(r.local_to_world[0], local), dot(r.local_to_world[1], local), dot(r.local_to_world[2], local));
}

/// The same, moved by other rows of local_to_world.
vec3 moved_position(IN(InstanceRecord) r, uint primitive, float u, float v, Vec4Array rows, uint first_row) {
  vec4 local = vec4(local_position(r, primitive, u, v), 1.0f);
  return vec3(dot(rows.at[first_row], local), dot(rows.at[first_row + 1u], local), dot(rows.at[first_row + 2u], local));
}
#endif
