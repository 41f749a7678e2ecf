// SPDX-License-Identifier: Apache-2.0
// What a plain surface reflects of light from one direction and from all sides.
#ifndef KUAFU_REFLECTED_GLSL
#define KUAFU_REFLECTED_GLSL
#include "lib/bsdf.glsl"

struct Reflected {
  float f;           // times the cosine, of light from wi
  float matt, lobes; // shares of light from all sides: by the base, and by lobes about the mirrored direction
};

Reflected reflected(IN(MaterialPoint) m, Vec2Array table, vec3 wo, vec3 wi) {
  Bsdf b = make_bsdf(m, table, wo, true);
  float pdf, below;
  Reflected r;
  r.f = bsdf_evaluate(b, table, wo, wi, vec3(0.0f), pdf);
  vec3 shares = lobe_weights(b, below);
  r.matt = shares.x;
  r.lobes = shares.y + shares.z;
  return r;
}

/// A material without textures, whose lobes of its own are left out.
MaterialPoint plain_material(IN(MaterialRecord) m) {
  MaterialPoint p;
  p.base = band_of(m.base_color);
  p.metallic = m.metallic;
  p.roughness = m.roughness;
  p.specular = m.specular;
  p.ior = m.ior;
  p.transmission = m.transmission;
  p.coat = m.specular * m.coat;
  return p;
}
#endif
