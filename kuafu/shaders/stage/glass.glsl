// SPDX-License-Identifier: Apache-2.0
// What one smooth surface lets through of a shadow ray, straight: of stage `transmit` and of tracers that follow such rays by themselves.
/// `shade` took the medium to fill the whole way; what of it lies in a body does not dim.
Spectrum inside_instead_of_fog(IN(Ray) ray, float t) {
  if (push.has_medium == 0u) return Spectrum(1.0f);
  Spectrum dimmed = medium_transmittance(push.scene.at[0].medium.at[0], ray.origin, ray.direction, 0.0f, t);
  return Spectrum(1.0f) / max(dimmed, Spectrum(1e-30f));
}

/// The ray's origin goes to the far side. `bent`: glass of bodies lets nothing through on a straight way.
Spectrum pass_surface(IN(MetSurface) met, float time_s, bool bent, INOUT(Ray) ray) {
  IN(SceneAddresses) scene = push.scene.at[0];
  Surface s = surface_at(scene, met.instance, met.primitive, met.u, met.v, time_s);
  MaterialPoint m = load_material(scene, scene.materials.at[s.material], s);
  bool front = dot(s.geometric_normal, ray.direction) <= 0.0f;
  if (bent && bends_light(m)) return Spectrum(0.0f);
  Spectrum transmittance = straight_transmittance(m, abs(dot(s.shading_normal, ray.direction)));
  if ((features & feature_materials) != 0u && !front) transmittance *= band_exp(m.attenuation * -met.t);
  if ((features & feature_medium) != 0u && !front && !is_sheet(m) && m.transmission > 0.0f && max_component(transmittance) > 0.0f)
    transmittance *= inside_instead_of_fog(ray, met.t);
  ray.origin = offset_origin(s.position, s.coordinate_size, front ? -s.geometric_normal : s.geometric_normal);
  return transmittance;
}
