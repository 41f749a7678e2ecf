// SPDX-License-Identifier: Apache-2.0
// A surface point as a projector sees it.
#ifndef KUAFU_PROJECTOR_VIEW_GLSL
#define KUAFU_PROJECTOR_VIEW_GLSL
#include "lib/frame.glsl"
#include "lib/light_shape.glsl"
#include "lib/queue.glsl"

struct ProjectorView {
  bool inside;     // its pattern, which ends half a pixel beyond its outer pixels' centres
  vec2 pixel;      // of the pattern
  float geometry;  // cos / d^2, 1/m^2; 0 where the surface faces away
  Ray ray;         // from the point to the projector
};

/// `normal` is the shading normal and `side_normal` the geometric one, both on the side that the camera sees.
ProjectorView projector_view(ProjectorRecord projector, IN(Surface) s, vec3 normal, vec3 side_normal) {
  ProjectorView view;
  vec3 way = projector.light.position - s.position;
  view.inside = pattern_pixel(projector.shape, to_light_frame(projector.shape, -way), view.pixel) && view.pixel.x >= -0.5f &&
                view.pixel.y >= -0.5f && view.pixel.x < float(projector.light.width) - 0.5f &&
                view.pixel.y < float(projector.light.height) - 0.5f;
  float distance_squared = max(dot(way, way), 1e-12f), distance = sqrt(distance_squared);
  view.geometry = dot(way, side_normal) > 0.0f ? max(dot(way, normal), 0.0f) / (distance * distance_squared) : 0.0f;
  view.ray = Ray(offset_origin(s.position, s.coordinate_size, side_normal), 0.0f, way / distance, distance * 0.99999f);
  return view;
}
#endif
