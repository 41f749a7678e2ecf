// SPDX-License-Identifier: Apache-2.0
// The ray of a camera with a lens and a shutter: where on the lens it starts, where it goes, and when.
#ifndef KUAFU_CAMERA_GLSL
#define KUAFU_CAMERA_GLSL
#include "lib/distortion.glsl"
#include "lib/motion.glsl"
#include "lib/pixels.glsl"

/// What a sample draws; the middle of each is the pixel's centre, mid-exposure and the lens' centre.
struct CameraSample {
  vec2 image_point;     // pixels
  vec2 lens;     // point of the unit disk
  float moment;  // -0.5..0.5 of the exposure
};

struct CameraRay {
  vec3 origin;
  vec3 direction;  // z is 1 in the camera's frame
  float time_s;
};

vec3 image_point_direction(IN(ViewRecord) view, IN(CameraRecord) camera, vec2 image_point) {
  if ((camera.flags & camera_distorts) == 0u) return view.axis_0 + image_point.x * view.axis_u + image_point.y * view.axis_v;
  float y = (image_point.y - camera.centre.y) / camera.focal.y;
  vec2 p = undistort(camera.lens, vec2((image_point.x - camera.centre.x - camera.skew * y) / camera.focal.x, y));
  return camera.axis_x * p.x + camera.axis_y * p.y + camera.axis_z;
}

/// Seconds from mid-exposure of the middle line.
float exposure_time(IN(CameraRecord) camera, Pixel pixel, IN(WaveRange) range, float moment) {
  vec2 from_middle = vec2(float(pixel.column), float(pixel.row)) - 0.5f * vec2(float(range.width - 1u), float(range.height - 1u));
  return dot(from_middle, camera.seconds_per_pixel) + moment * camera.exposure_s;
}

CameraRay camera_ray(IN(ViewRecord) view, IN(CameraRecord) camera, Pixel pixel, IN(WaveRange) range, CameraSample s) {
  CameraRay ray = CameraRay(vec3(0.0f), image_point_direction(view, camera, s.image_point), exposure_time(camera, pixel, range, s.moment));
  if ((camera.flags & camera_has_lens) != 0u) {  // all rays of a image_point point meet at the focused distance
    ray.origin = camera.lens_radius_m * (s.lens.x * camera.axis_x + s.lens.y * camera.axis_y);
    ray.direction -= ray.origin * camera.inverse_focus;
  }
  if ((camera.flags & camera_moves) != 0u) {
    ray.origin = moved_direction(camera.motion, ray.time_s, ray.origin) + path_at(camera.motion, ray.time_s);
    ray.direction = moved_direction(camera.motion, ray.time_s, ray.direction);
  }
  ray.origin += view.origin;
  return ray;
}

/// Concentric map of the unit square onto the unit disk (Shirley and Chiu 1997): keeps strata compact.
vec2 unit_disk(vec2 u) {
  vec2 p = 2.0f * u - 1.0f;
  if (p.x == 0.0f && p.y == 0.0f) return p;
  bool wide = abs(p.x) > abs(p.y);
  float radius = wide ? p.x : p.y;
  float angle = 0.7853981634f * (wide ? p.y / p.x : 2.0f - p.x / p.y);
  return vec2(radius * cos(angle), radius * sin(angle));
}
#endif
