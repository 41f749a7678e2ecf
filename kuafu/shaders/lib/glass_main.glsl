// Entry of both trace_glass shaders: a shadow ray's whole way through smooth surfaces, in one go. What stage `transmit` does ray queue by ray queue.
// t_far becomes minus infinity where something stands in the way; else the contribution is dimmed.
#include "shared/wave.h"
// What stage/glass.glsl reads, beyond what every tracer is given.
#define KUAFU_MORE_PUSH uint surfaces; FloatArray contributions; SceneReference scene; uint has_medium, unused;
#include "lib/bvh_queue.glsl"

layout(constant_id = 3) const uint features = 0u;
#define queue_layout layout_kind
#include "lib/shading.glsl"
#include "stage/glass.glsl"

/// Whether light gets through; `light` is what of it.
bool pass_glass(uint root, bool opaque, BvhRay seen, inout Spectrum light) {
  Ray ray = Ray(seen.origin, seen.t_near, seen.direction, seen.t_far);
  for (uint passed = 0u; ray.t_far > 0.0; ++passed) {
    bool last = opaque || passed >= push.surfaces;
    seen = BvhRay(ray.origin, ray.t_near, ray.direction, ray.t_far, seen.time_s);
    BvhHit hit;
    if (!bvh_trace(push.nodes, push.instances, push.motions, root, last, seen, hit)) return true;
    if (last) return false;
    light *= pass_surface(MetSurface(hit.instance, hit.primitive, hit.uv.x, hit.uv.y, seen.t_far), seen.time_s, ray);
    if (max_component(light) == 0.0) return false;
    ray.t_near = 0.0;
    ray.t_far -= seen.t_far;
  }
  return true;
}

void main() {
  uint i = queue_ray_index();
  if (i >= queue_ray_count()) return;
  bool opaque = (push.words.word[queue_word(i, ray_id, occlusion_words)] & shadow_opaque) != 0u;
#if KUAFU_CHANNELS == 1
  Spectrum light = push.contributions.at[i], before = light;
#else
  Spectrum light = vec3(push.contributions.at[i], push.contributions.at[push.capacity + i], push.contributions.at[2u * push.capacity + i]), before = light;
#endif
  if (!pass_glass(queue_root(i), opaque, queue_ray(i, occlusion_words), light))
    queue_store(i, ray_t_far, occlusion_words, 0xff800000u);
  else if (light != before)
    for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.capacity + i] = channel_of(light, c);
}
