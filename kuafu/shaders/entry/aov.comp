// Depth, normal and ids of what the ray through each pixel's centre met.
#version 460
#extension GL_GOOGLE_include_directive : require
#define KUAFU_CHANNELS 3
#include "lib/material.glsl"
#include "lib/pixels.glsl"
#include "lib/queue.glsl"

layout(push_constant, scalar) uniform Push { AovPush push; };

void write_word(uint kind, Pixel pixel, uint channel_count, uint channel, uint value) {
  OutputRecord record = push.outputs.at[kind];
  if (record.enabled != 0u) record.words.at[output_word(record, pixel, channel_count) + channel] = value;
}

uint hit_word(uint i, uint field) { return push.rays.at[ray_word(i, field, closest_words, queue_layout, push.range.capacity)]; }

void main() {
  uint i = gl_GlobalInvocationID.x;
  if (i >= push.range.pixel_count) return;
  Pixel pixel = wave_pixel(push.range, i);
  float z = 0.0;
  vec3 normal = vec3(0.0);
  uint instance_id = miss, material_id = miss;
  if (hit_word(i, hit_geometry) != miss) {
    SceneAddresses scene = push.scene.at;
    ViewRecord view = push.views.at[pixel.view];
    Surface s = load_surface(scene, scene.instances.at[hit_word(i, hit_instance)], hit_word(i, hit_primitive),
                             uintBitsToFloat(hit_word(i, hit_u)), uintBitsToFloat(hit_word(i, hit_v)));
    MaterialRecord m = scene.materials.at[s.material];
    load_material(scene, m, s);
    z = uintBitsToFloat(hit_word(i, ray_t_far)) / length(view.axis_0 + float(pixel.column) * view.axis_u + float(pixel.row) * view.axis_v);
    bool front = dot(s.geometric_normal, load_vec3(push.rays, i, ray_direction, closest_words, push.range.capacity)) <= 0.0;
    normal = front ? s.shading_normal : -s.shading_normal;
    instance_id = s.instance_id;
    material_id = m.id;
  }
  write_word(output_depth, pixel, 1u, 0u, floatBitsToUint(z));
  for (uint c = 0u; c < 3u; ++c) write_word(output_normal, pixel, 3u, c, floatBitsToUint(normal[c]));
  write_word(output_instance_id, pixel, 1u, 0u, instance_id);
  write_word(output_material_id, pixel, 1u, 0u, material_id);
}
