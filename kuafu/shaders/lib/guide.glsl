// SPDX-License-Identifier: Apache-2.0
// The guide of what a ray met; includers have `push.rays`, `push.scene`, `push.views`, `push.range` and `push.infrared`, and include it
// where `push` is.

const float least_albedo = 0.02f;  // darker surfaces are divided by this: less would make noise of rounding
const float least_alpha = 0.02f;   // sharper reflections change within a pixel, whatever the normals say

uint guide_word(uint i, uint field) { return push.rays.at[closest_word(i, field, push.range.capacity)]; }

GuideRecord guide_of_ray(uint i, uint view) {
  GuideRecord g;
  g.material = miss;
  g.albedo = vec3(1.0f);
  g.normal = g.position = vec3(0.0f);
  g.footprint_m = g.normal_exponent = 0.0f;
  if (guide_word(i, hit_geometry) == miss) return g;
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, guide_word(i, hit_instance), guide_word(i, hit_primitive),
                         uintBitsToFloat(guide_word(i, hit_u)), uintBitsToFloat(guide_word(i, hit_v)), uintBitsToFloat(guide_word(i, ray_time)));
  IN(MaterialRecord) m = scene.materials.at[s.material];
  MaterialPoint p = load_material(scene, m, s);
  bool front = dot(s.geometric_normal, load_direction(push.rays, i, push.range.capacity)) <= 0.0f;
  g.normal = front ? s.shading_normal : -s.shading_normal;
  g.material = m.id;
  g.position = s.position;
  g.footprint_m = uintBitsToFloat(guide_word(i, ray_t_far)) * length(push.views.at[view].axis_u);
  vec3 base = push.infrared == 0u ? p.base : vec3(p.base.x);
  g.albedo = max(base, vec3(least_albedo));
  // A reflection changes over the angle that the GGX lobe is wide, and turns twice as fast as the normal.
  float alpha = max(p.roughness * p.roughness, least_alpha);
  g.normal_exponent = mix(matt_exponent, max(matt_exponent, 0.5f / (alpha * alpha)), p.metallic);
  return g;
}
