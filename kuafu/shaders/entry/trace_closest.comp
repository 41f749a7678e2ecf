#version 460
// Nearest hit of each ray of a queue; a miss leaves the ray as it was.
#extension GL_GOOGLE_include_directive : require
#include "lib/bvh_queue.glsl"

void main() {
  uint i = queue_ray_index();
  if (i >= queue_ray_count()) return;
  BvhRay ray = queue_ray(i, closest_words);
  BvhHit hit;
  if (!bvh_trace(push.nodes, push.instances, push.motions, queue_root(i), false, ray, hit)) return;
  queue_store(i, ray_t_far, closest_words, floatBitsToUint(ray.t_far));
  queue_store(i, hit_u, closest_words, floatBitsToUint(hit.uv.x));
  queue_store(i, hit_v, closest_words, floatBitsToUint(hit.uv.y));
  queue_store(i, hit_primitive, closest_words, hit.primitive);
  queue_store(i, hit_geometry, closest_words, 0u);
  queue_store(i, hit_instance, closest_words, hit.instance);
}
