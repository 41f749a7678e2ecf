// SPDX-License-Identifier: Apache-2.0
// Stage `blend`: the guide of a pixel whose rays go through a lens or an exposure is of all that they meet. Its light is divided by their mean albedo, so that
// what is blurred stays blurred; pixels that show several materials mix among themselves.
void blend(uint local_pixel) {
  Pixel pixel = wave_pixel(push.range, local_pixel);
  uint index = (pixel.view * push.range.height + pixel.row) * push.range.width + pixel.column;
  GuideRecord g = load_guide(push.guides, index);
  vec3 albedo = vec3(0.0f), normal = vec3(0.0f), first = vec3(0.0f), offset = vec3(0.0f);
  float square = 0.0f, hits = 0.0f, share = 1.0f / float(push.range.sample_count);
  for (uint s = 0u; s < push.range.sample_count; ++s) {
    GuideRecord ray = guide_of_ray(local_pixel * push.range.sample_count + s, pixel.view);
    albedo += share * ray.albedo;
    if (ray.material != g.material) g.material = mixed_materials;
    if (ray.material == miss) continue;
    if (hits == 0.0f) {
      first = ray.position;
      g.footprint_m = ray.footprint_m;
      g.normal_exponent = ray.normal_exponent;
    }
    hits += 1.0f;
    normal += ray.normal;
    g.normal_exponent = min(g.normal_exponent, ray.normal_exponent);
    vec3 from_first = ray.position - first;
    offset += from_first;
    square += dot(from_first, from_first);
  }
  g.albedo = albedo;
  if (hits > 0.0f) {
    offset /= hits;
    g.position = first + offset;
    g.footprint_m = sqrt(g.footprint_m * g.footprint_m + max(0.0f, square / hits - dot(offset, offset)));
    if (dot(normal, normal) > 0.0f) g.normal = normalize(normal);
  }
  store_guide(push.squares_or_blended, index, g);
}
