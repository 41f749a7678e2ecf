#version 460
// Any hit of each ray of a queue: t_far becomes minus infinity where something stands in the way.
#extension GL_GOOGLE_include_directive : require
#include "lib/bvh_queue.glsl"

void main() {
  uint i = queue_ray_index();
  if (i >= queue_ray_count()) return;
  BvhRay ray = queue_ray(i, occlusion_words);
  BvhHit hit;
  if (bvh_trace(push.nodes, push.instances, push.motions, queue_root(i), true, ray, hit))
    queue_store(i, ray_t_far, occlusion_words, 0xff800000u);
}
