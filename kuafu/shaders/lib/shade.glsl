// Stage `shade`: what a path does where its ray ended. Light that is simply there (environment, emission) is added; for each light one shadow ray is queued;
// the BSDF gives the next ray. KUAFU_CHANNELS is defined by the entry file.
#ifndef KUAFU_SHADE_GLSL
#define KUAFU_SHADE_GLSL
#include "lib/bsdf.glsl"
#include "lib/frame.glsl"
#include "lib/light.glsl"
#include "lib/queue.glsl"
#include "lib/sequence.glsl"

layout(push_constant, scalar) uniform Push { ShadePush push; };

struct Path {
  uint slot, key, index, flags;
  Spectrum throughput;
};

struct Vertex {
  vec3 position;
  float coordinate_size;
  vec3 side_normal;  // geometric, on the viewer's side
  Frame frame;       // shading, on the viewer's side
  vec3 wo;           // local
  Bsdf bsdf;
  vec3 chances;
};

uint plane(uint p, uint slot) { return p * push.capacity + slot; }

Path load_path(uint i) {
  Path p;
  p.slot = push.rays_in.at[ray_word(i, ray_id, closest_words, queue_layout, push.capacity)];
  p.key = push.state.at[plane(state_pixel_key, p.slot)];
  p.index = push.state.at[plane(state_sample, p.slot)];
  p.flags = push.state.at[plane(state_flags, p.slot)];
#if KUAFU_CHANNELS == 1
  p.throughput = uintBitsToFloat(push.state.at[plane(state_throughput, p.slot)]);
#else
  for (uint c = 0u; c < channels; ++c) p.throughput[c] = uintBitsToFloat(push.state.at[plane(state_throughput + c, p.slot)]);
#endif
  return p;
}

void store_path(Path p) {
  push.state.at[plane(state_flags, p.slot)] = p.flags;
  for (uint c = 0u; c < channels; ++c) push.state.at[plane(state_throughput + c, p.slot)] = floatBitsToUint(channel_of(p.throughput, c));
}

void add_radiance(uint slot, uint group, Spectrum radiance) {
  for (uint c = 0u; c < channels; ++c) {
    uint word = plane(state_radiance(channels) + group * channels + c, slot);
    push.state.at[word] = floatBitsToUint(uintBitsToFloat(push.state.at[word]) + channel_of(radiance, c));
  }
}

/// The surface that ray i met; adds its emission to the path.
Vertex load_vertex(uint i, Path path) {
  uint instance = push.rays_in.at[ray_word(i, hit_instance, closest_words, queue_layout, push.capacity)];
  uint primitive = push.rays_in.at[ray_word(i, hit_primitive, closest_words, queue_layout, push.capacity)];
  float u = uintBitsToFloat(push.rays_in.at[ray_word(i, hit_u, closest_words, queue_layout, push.capacity)]);
  float v = uintBitsToFloat(push.rays_in.at[ray_word(i, hit_v, closest_words, queue_layout, push.capacity)]);
  vec3 wo = -load_vec3(push.rays_in, i, ray_direction, closest_words, push.capacity);
  SceneAddresses scene = push.scene.at;
  Surface s = load_surface(scene, scene.instances.at[instance], primitive, u, v);
  MaterialPoint m = load_material(scene, scene.materials.at[s.material], s);
  if (max_component(m.emission) > 0.0) add_radiance(path.slot, group_ambient, path.throughput * m.emission);
  bool front = dot(s.geometric_normal, wo) >= 0.0;
  Vertex vertex;
  vertex.position = s.position;
  vertex.coordinate_size = s.coordinate_size;
  vertex.side_normal = front ? s.geometric_normal : -s.geometric_normal;
  vec3 normal = front ? s.shading_normal : -s.shading_normal;
  // An interpolated normal may face away from the viewer, where GGX is not defined: bend it back. Lambert needs no viewer.
  float facing = dot(normal, wo);
  if (facing < 1e-3 && m.specular + m.metallic > 0.0) normal = normalize(normal + (1e-3 - facing) * wo);
  vertex.frame = frame_around(normal);
  vertex.wo = to_local(vertex.frame, wo);
  vertex.bsdf = make_bsdf(m, scene.specular_albedo, vertex.wo.z, front);
  vertex.chances = lobe_chances(vertex.bsdf, scene.specular_albedo, vertex.wo.z);
  return vertex;
}

/// Queues the k-th shadow ray of the vertex; call in uniform control flow.
void ask_light(uint k, bool lit, Path path, Vertex vertex) {
  LightSample light;
  Spectrum contribution = Spectrum(0.0);
  uint group = group_ambient;
  if (lit) {
    SceneAddresses scene = push.scene.at;
    bool all_delta = (path.flags & path_all_delta) != 0u, select = (push.flags & shade_select_lights) != 0u;
    float u = select ? sample_2d(path.key, path.index, pair_light(push.bounce)).x : 0.0;
    EnvironmentRecord environment = scene.environments.at[path.flags & path_environment_mask];
    LightChoice choice = vertex_light(scene.lights, environment, k, select, all_delta, u);
    if (choice.probability > 0.0) {
      LightRecord record = scene.lights.at[choice.index];
      light = light_at(record, vertex.position);
      if (max_component(light.irradiance) > 0.0 && dot(light.direction, vertex.side_normal) > 0.0) {
        float pdf;
        Spectrum f = bsdf_evaluate(vertex.bsdf, scene.specular_albedo, vertex.wo, to_local(vertex.frame, light.direction), vertex.chances, pdf);
        contribution = path.throughput * f * light.irradiance / choice.probability;
      }
      if (record.kind == light_projector) group = all_delta ? group_projector_direct : group_projector_indirect;
    }
  }
  bool wanted = max_component(contribution) > 0.0;
  uint block = push.bounce * counter_words, end;
  uint i = append(wanted, push.counters, block + counter_shadow_count, end);
  if (end > 0u && subgroupElect())
    store_arguments(push.counters, block + counter_shadow_arguments, (end + trace_group_size - 1u) / trace_group_size);
  if (wanted) {
    store_ray(push.shadow_rays, i, occlusion_words, push.shadow_capacity, offset_origin(vertex.position, vertex.coordinate_size, vertex.side_normal), 0.0,
              light.direction, light.distance_m * 0.99999, path.slot);
    if ((push.flags & shade_environments) != 0u) push.shadow_environments.at[i] = path.flags & path_environment_mask;
    for (uint c = 0u; c < channels; ++c) push.contributions.at[c * push.shadow_capacity + i] = channel_of(contribution, c);
  }
  if (path.slot != miss)
    push.state.at[plane(state_shadow(channels) + k, path.slot)] = wanted ? i | (group << shadow_group_shift) : shadow_none;
}

/// Samples the next direction into `direction`; false when the path ends here.
bool scatter(inout Path path, Vertex vertex, out vec3 direction) {
  vec2 choice = sample_2d(path.key, path.index, pair_choice(push.bounce));
  BsdfSample s = bsdf_sample(vertex.bsdf, push.scene.at.specular_albedo, vertex.wo, vertex.chances,
                             sample_2d(path.key, path.index, pair_direction(push.bounce)), choice.x);
  direction = to_world(vertex.frame, s.direction);
  // The shading normal may send a ray to the wrong side of the triangle.
  if (s.transmitted == (dot(direction, vertex.side_normal) > 0.0)) return false;
  path.throughput *= s.weight;
  if (!s.delta) path.flags &= ~path_all_delta;
  float survival = max_component(path.throughput);
  if (push.bounce >= 3u && survival < 1.0) {  // Russian roulette
    if (choice.y >= survival) return false;
    path.throughput /= survival;
  }
  return survival > 0.0;
}

void shade() {
  uint i = gl_GlobalInvocationID.x, block = push.bounce * counter_words;
  bool live = i < push.counters.at[block + counter_ray_count];
  Path path;
  path.slot = miss;
  Vertex vertex;
  bool hit = false;
  if (live) {
    path = load_path(i);
    hit = push.rays_in.at[ray_word(i, hit_geometry, closest_words, queue_layout, push.capacity)] != miss;
    if (hit) vertex = load_vertex(i, path);
    else {
      vec3 radiance = push.scene.at.environments.at[path.flags & path_environment_mask].radiance;
      add_radiance(path.slot, group_ambient, path.throughput * band_of(radiance, radiance.x));
    }
  }
  hit = hit && push.bounce <= push.max_bounces;
  bool lit = hit && takes_light(vertex.bsdf);
  for (uint k = 0u; k < push.shadow_rays_per_vertex; ++k) ask_light(k, lit, path, vertex);

  vec3 direction;
  bool onward = hit && (push.bounce < push.max_bounces || (push.flags & shade_ambient) != 0u) && scatter(path, vertex, direction);
  uint next_block = block + counter_words, end;
  uint next = append(onward, push.counters, next_block + counter_ray_count, end);
  if (end > 0u && subgroupElect()) {
    store_arguments(push.counters, next_block + counter_trace_arguments, (end + trace_group_size - 1u) / trace_group_size);
    store_arguments(push.counters, next_block + counter_shade_arguments, (end + gl_WorkGroupSize.x - 1u) / gl_WorkGroupSize.x);
  }
  if (onward) {
    vec3 outward = dot(direction, vertex.side_normal) > 0.0 ? vertex.side_normal : -vertex.side_normal;
    store_closest_ray(push.rays_out, next, push.capacity, offset_origin(vertex.position, vertex.coordinate_size, outward), 0.0, direction,
                      uintBitsToFloat(0x7f800000u), path.slot);
    if ((push.flags & shade_environments) != 0u) push.ray_environments.at[next] = path.flags & path_environment_mask;
    store_path(path);
  }
}
#endif
